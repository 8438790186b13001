"""An Abaqus or CalculiX deck becomes a scenario: `convert(path, out)` (docs/init.md)."""

from coupler.deck.convert import convert
from coupler.deck.lexer import Converted, Missed

__all__ = ["Converted", "Missed", "convert"]
