"""A study: one scenario solved in many ways, and what each way costs and is worth."""

from __future__ import annotations

from coupler.study.conduct import How, Study, conduct
from coupler.study.grid import grid_of, parse_axis
from coupler.study.page import write_study
from coupler.study.show import StudyLine

__all__ = ["How", "Study", "StudyLine", "conduct", "grid_of", "parse_axis", "write_study"]
