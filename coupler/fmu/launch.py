"""Halves of a scenario: built into FMUs, loaded in this process or each in one of its own."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coupler.errors import ScenarioError
from coupler.fmu.builders import build_half
from coupler.fmu.fmi import load_half
from coupler.fmu.half import Half
from coupler.scenario import Scenario


@dataclass(frozen=True)
class Launched:
    """The two halves, loaded but not initialised.

    link : how they reach contact (parameter contact.link).  asked : what a contact service in a process of its own was
    asked so far, by verb.
    """

    thermal: Half
    mechanical: Half
    link: str
    asked: Callable[[], dict[str, Any]] = dict


@contextmanager
def launch(scenario: Scenario, *, processes: bool) -> Iterator[Launched]:
    """Build and load both halves; close them, and end their processes, on the way out.

    Raises HalfError naming the half that cannot be built or loaded.
    """
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="slideline-")))
        fmus = {role: build_half(scenario.write_half(role, folder), folder)
                for role, folder in (("thermal", scratch / "thermal"), ("mechanical", scratch / "mechanical"))}
        if processes:
            from coupler.fmu.processes import processes as in_processes  # embedded runs do not load zenoh

            hosted = stack.enter_context(in_processes(fmus))
            yield Launched(hosted.halves["thermal"], hosted.halves["mechanical"], hosted.contact_link,
                           hosted.asked)
            return
        halves = {}
        for role, fmu in fmus.items():
            halves[role] = load_half(fmu, None, role)
            stack.callback(halves[role].close)
        yield Launched(halves["thermal"], halves["mechanical"], scenario.coupling.link)


def make_folder(folder: Path) -> None:
    """Make a folder the user asked for.  Raises ScenarioError if that is not possible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise ScenarioError(f"this folder cannot be made ({exc.strerror})", file=str(folder),
                            remedy="Give another one") from exc


def build_halves(scenario: Scenario, folder: Path) -> list[Path]:
    """Build both FMUs of a scenario into a folder: thermal.fmu, mechanical.fmu.

    Raises ScenarioError if the folder cannot be made, HalfError if a half cannot be built.
    """
    make_folder(folder)
    built = []
    with tempfile.TemporaryDirectory(prefix="slideline-") as scratch:
        for role in ("thermal", "mechanical"):
            directory = Path(scratch) / role
            fmu = build_half(scenario.write_half(role, directory), directory)
            built.append(Path(shutil.copyfile(fmu, folder / f"{role}.fmu")))
    return built
