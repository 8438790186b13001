"""What several verbs of the command line share: their options, and how they end."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from contact.problem.units import UnitError, as_float, quantity_from, unit_from
from coupler.cli.codes import exit_code
from coupler.errors import ScenarioError
from coupler.init.shipped import shipped_scenarios

if TYPE_CHECKING:
    from coupler.record.results import Results
    from coupler.scenario import Scenario


def installed(path: Path) -> Path:
    """Return the file that a name of `slideline list` stands for; a path as it is."""
    # fault: a name that `list` tells is no scenario -> if False: | coupler/test_cli
    if _is_listed(path):
        return shipped_scenarios() / f"{path}.yaml"
    # fault: a name that is nearly one of `list` is a file that is missing -> if False: | coupler/test_cli
    if not path.exists() and path.name == str(path):
        _suggest(path)
    return path


def _suggest(path: Path) -> None:
    """Raise ScenarioError for what is neither a file nor a listed name, but nearly one."""
    names = sorted(file.stem for file in shipped_scenarios().glob("*.yaml"))
    near = difflib.get_close_matches(path.stem, names, n=1, cutoff=0.75)
    if near:
        raise ScenarioError("there is no such file", file=str(path),
                            remedy=f"Did you mean the installed scenario {near[0]!r}? Give its name, without an ending")


def _is_listed(path: Path) -> bool:
    if path.exists() or path.suffix or path.name != str(path):
        return False
    return (shipped_scenarios() / f"{path}.yaml").is_file()


ScenarioFile = Annotated[Path, typer.Argument(
    help="The scenario, a YAML file, or a name of `slideline list`.", show_default=False, callback=installed)]
SetOption = Annotated[list[str] | None, typer.Option(
    "--set", metavar="KEY=VALUE", help="Change a value: coupling.scheme=staggered. May be repeated.")]
ChangeOption = Annotated[list[str] | None, typer.Option(
    "--set", metavar="KEY=VALUE", help="Change how the next windows are solved: coupling.scheme=iterated, or "
    "coupling.substeps, .iteration, .adaptive.most. May be repeated.")]
SwapOption = Annotated[list[str] | None, typer.Option(
    "--swap", metavar="HALF=KIND", help="Use another half: mechanical=rigid. May be repeated.")]


def _seconds(text: str) -> float:
    """Read a time: seconds, or a number with a unit as a scenario has it.  Raises ScenarioError."""
    try:
        # fault: a time in minutes is no time -> quantity = quantity_from("0") | coupler/test_cli
        quantity = quantity_from(text.strip())
        if quantity is not None and quantity.powers == unit_from("s").powers:
            return as_float(quantity.si())
        return float(text)
    except ValueError as exc:
        remedy = exc.remedy if isinstance(exc, UnitError) else ""
        raise ScenarioError("a time is needed here", key="--until", value=text,
                            remedy=remedy or "Give seconds, or a number with a unit: '5 min'") from None


def _after_the_start(until: float | None) -> float | None:
    # fault: a run may be asked to end before it starts -> if False: | coupler/test_cli
    if until is not None and not until > 0.0:
        raise ScenarioError("no window ends at or before this time", key="--until", value=until,
                            remedy="Give seconds of simulated time, greater than 0")
    return until


UntilOption = Annotated[float | None, typer.Option(
    # fault: an option that the pages name is renamed -> "--til", metavar="SECONDS", callback=_after_the_start, |
    #   test_docs::test_commands_and_options_exist
    "--until", metavar="SECONDS", callback=_after_the_start, parser=_seconds,
    help="Stop at the first window end at or after this time; `resume` continues.")]
ProcessesOption = Annotated[bool, typer.Option(
    "--processes", help="Run each half and the contact service in its own process.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")]
HostsOption = Annotated[Path | None, typer.Option(
    "--hosts", metavar="FILE", help="Run each half and the contact service on the machines that this file names.")]
LogOption = Annotated[Path | None, typer.Option(
    "--log", metavar="FILE", help="Append a line of JSON for each window to this file.")]
WithinOption = Annotated[str, typer.Option(
    "--within", metavar="BOUNDS", help="Allowed difference of the runs, T=1K,p=1% (of the range). Default: the "
    "errors that both runs estimate.")]


def overrides_of(sets: Sequence[str] | None, swaps: Sequence[str] | None) -> dict[str, Any]:
    # Here and not above: who reads results loads nothing that reads a scenario.
    from coupler.scenario import parse_override

    overrides: dict[str, Any] = dict(parse_override(text) for text in sets or ())
    for text in swaps or ():
        half, sep, kind = text.partition("=")
        role, _, one = half.partition(".")
        if sep and kind and role == "thermal" and one:
            # fault: one of several halves is not swapped -> overrides["thermal.half"] = kind |
            #   coupler/test_several_stated
            overrides[f"thermal.halves.{one}.half"] = kind
            continue
        if not sep or half not in ("thermal", "mechanical") or not kind:
            raise ScenarioError("expects thermal=KIND or mechanical=KIND", key="--swap", value=text,
                                remedy="For example --swap mechanical=rigid")
        overrides[f"{half}.half"] = kind
    return overrides


def scenario_of(path: Path, sets: Sequence[str] | None, swaps: Sequence[str] | None) -> Scenario:
    """The scenario with what options change."""
    from coupler.scenario import load_scenario

    return load_scenario(path, overrides=overrides_of(sets, swaps))


def own_scenario_of(path: Path, sets: Sequence[str] | None, swaps: Sequence[str] | None) -> Scenario:
    """The scenario with its own halves, without the options that were set for those in their place."""
    theirs = tuple(f"{text.partition('=')[0]}.options" for text in swaps or ())
    # fault: our own half is given the options of the one that is compared -> kept = list(sets or ()) |
    #   coupler/test_verdict
    kept = [text for text in sets or () if not text.strip().startswith(theirs)]
    return scenario_of(path, kept, None)


def leave(results: Results) -> None:
    """End with the exit code of a run that was not finished, or is not to be trusted."""
    if code := exit_code(results):
        raise typer.Exit(code)
