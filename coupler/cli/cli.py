"""The command line: which verbs there are, and where each is.

A verb is imported when it is called: `--help` reads this file alone, and what only reads a scenario loads no solver.
Exit codes: 0 done; 1 the run failed (a window that cannot be solved, a half that died, a broken link);
2 the input is wrong (scenario, options); 3 a results file cannot be read or written; 4 the run finished, but a check of
its own says that its answer is not to be trusted; 5 two runs that were compared differ, or are of two scenes; 130
interrupted.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from typing import Annotated, Any, cast

import typer
from typer.core import TyperCommand, TyperGroup
from typer.exceptions import TyperException
from typer.main import get_command

from contact.compiled import interpret
from contact.rpc.calls import LinkError
from coupler.cli.codes import BAD_INPUT, BAD_RESULTS, FAILED, INTERRUPTED
from coupler.errors import ResultsError, ScenarioError, SlidelineError


@dataclass(frozen=True)
class Verb:
    """A command.  home : module:function.  about : the first sentence of the function's docstring.  solves : it calls
    solvers or contact so often that compiling their kernels pays."""

    home: str
    about: str
    solves: bool = False


VERBS = {
    "init": Verb("coupler.init.init:init_command", about=
        "Write a new scenario: from a template, by questions or by options, or from a deck."),
    "check": Verb("coupler.cli.scene:check_command", about=
        "Check a scenario and print what it would run, without running it."),
    "show": Verb("coupler.cli.drawn:show_command", about=
        "Draw a scenario before it runs: bodies, meshes, pairs with their sides, conditions, probes."),
    "run": Verb("coupler.cli.running:run_command", solves=True, about=
        "Run a scenario; write run.h5 and a .vtkhdf file for each half."),
    "resume": Verb("coupler.cli.running:resume_command", solves=True, about=
        "Resume a run that was interrupted, stopped or killed, or that failed, into the same results file."),
    "status": Verb("coupler.cli.results:status_command", about=
        "Print the progress of a run, from another terminal, or how it ended."),
    "trace": Verb("coupler.cli.results:trace_command", about=
        "Write a trace of a run: when each call ran; for ui.perfetto.dev or chrome://tracing."),
    "report": Verb("coupler.cli.drawn:report_command", about=
        "Write a self-contained HTML page about a run."),
    "watch": Verb("coupler.cli.drawn:watch_command", about=
        "Write the report of a run while it goes on; the page reloads itself until the run ends."),
    "compare": Verb("coupler.cli.drawn:compare_command", about=
        "Compare two runs: the largest differences on a page, and a verdict."),
    "study": Verb("coupler.cli.trials:study_command", solves=True, about=
        "Run a grid of settings, and draw error against cost."),
    "advise": Verb("coupler.cli.trials:advise_command", solves=True, about=
        "Find the cheapest model within your tolerance, and write it as a scenario."),
    "build": Verb("coupler.cli.running:build_command", solves=True, about=
        "Build the FMUs of a scenario, for use in any FMI 2.0 or 3.0 master."),
    "verify-half": Verb("coupler.cli.verifying:verify_half_command", solves=True, about=
        "Check a half against the interface specification: names, units, state, discards, substeps."),
    "host": Verb("coupler.cli.hosting:host_command", about=
        "Run one role for runs on other machines; --init-tls makes the certificates."),
    "list": Verb("coupler.cli.tools:list_command", about=
        "List the installed scenarios and halves, with a sentence each."),
    "cache": Verb("coupler.cli.tools:cache_command", about=
        "Print the size of the cache of built halves, or clear it; beyond 2 GB it drops those not used for a day."),
    "schema": Verb("coupler.cli.scene:schema_command", about=
        "Write the JSON Schema of a scenario, for editors that complete and check keys."),
    "migrate": Verb("coupler.cli.scene:migrate_command", about=
        "Write a scenario of an older version as the newest version, with the same numbers."),
    "demo": Verb("coupler.cli.running:demo_command", solves=True, about=
        "Show a first result in seconds: the sliding blocks with the rigid half, and their report."),
}


def verb(name: str) -> TyperCommand:
    """Return a command of VERBS itself, imported."""
    module, _, function = VERBS[name].home.partition(":")
    one = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    one.command(name, cls=_OneVerb)(getattr(import_module(module), function))
    return cast(TyperCommand, get_command(one))


def _flags_bare(parameters: list[Any]) -> list[Any]:
    """The same parameters, whose flags are shown without a type: `--quiet <bool>` looks as if it took a value."""
    for parameter in parameters:
        # fault: the help shows a type behind a flag -> if False: |
        #   coupler/test_cli::test_flags_take_no_value
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
    return parameters


class _OneVerb(TyperCommand):
    def get_params(self, ctx: Any) -> list[Any]:
        return _flags_bare(super().get_params(ctx))


class _Named(TyperCommand):
    """A verb of which only its name and its sentence are known; whoever calls it gets the verb itself."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        return verb(str(self.name)).make_context(info_name, args, parent=parent, **extra)


class _Verbs(TyperGroup):
    def get_params(self, ctx: Any) -> list[Any]:
        return _flags_bare(super().get_params(ctx))

    def list_commands(self, ctx: Any) -> list[str]:
        return list(VERBS)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        # fault: a command that is not known has no near one -> if False: | coupler/test_cli
        if args[0] not in VERBS and not args[0].startswith("-"):
            from contact.problem.values import did_you_mean

            ctx.fail(f"No such command {args[0]!r}. {did_you_mean(args[0], VERBS)}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except TyperException as exc:
            # Of these typer tells people, and ends the process.
            # fault: a script that mistypes an option gets no JSON -> if False: | coupler/test_cli
            if "--json" in sys.argv[1:]:
                from coupler.cli.failure import misused

                typer.echo(json.dumps(misused(exc.format_message(), BAD_INPUT), indent=1))
            raise

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        return _Named(cmd_name, callback=None, help=VERBS[cmd_name].about) if cmd_name in VERBS else None


app = typer.Typer(cls=_Verbs, no_args_is_help=True, pretty_exceptions_enable=False,
                  help="Heat and deformation of bodies in contact: two solvers, each an FMU, coupled.")


def _tell_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"slideline {version('slideline')}")
        raise typer.Exit


@app.callback()
def options(version: Annotated[bool, typer.Option("--version", callback=_tell_version, is_eager=True,
                                                  help="Print the version and exit.")] = False) -> None:
    """Take the options that stand before a command."""


def main() -> None:
    """Run the command line: every expected error becomes one clear text and an exit code."""
    try:
        app()
    except (SlidelineError, LinkError) as exc:
        told = str(exc).splitlines() if isinstance(exc, ScenarioError) else [str(exc)]
        typer.echo("\n".join([*(f"error: {line}" for line in told), *getattr(exc, "__notes__", ())]), err=True)
        code = {ScenarioError: BAD_INPUT, ResultsError: BAD_RESULTS}.get(type(exc), FAILED)
        # fault: a script that reads a failed run gets no JSON -> if False: | coupler/test_cli
        if "--json" in sys.argv[1:]:
            from coupler.cli.failure import failure

            typer.echo(json.dumps(failure(exc, code), indent=1))
        sys.exit(code)
    except KeyboardInterrupt as exc:
        typer.echo("\n".join(getattr(exc, "__notes__", ())), err=True)
        sys.exit(INTERRUPTED)


def start() -> None:
    """Run the command line in a process of its own: what solves nothing compiles nothing."""
    named = next((VERBS[word] for word in sys.argv[1:] if word in VERBS), None)
    # A pilot run solves.
    # fault: a look at a scene compiles kernels -> if False: | coupler/test_cli_start
    if named is not None and not named.solves and "--pilot" not in sys.argv:
        interpret()
    main()
