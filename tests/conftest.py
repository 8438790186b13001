"""Which files make the tier `fast`, which cases are `slow`, and in which order files run (CONTRIBUTING.md).

`pytest -m fast` runs the files of FAST but for their slow cases, and no other file is even imported.  Files that take
long begin first, so that none of them is left to one process while the others have nothing to do.

`@pytest.mark.few(ID, ...)` names the cases of a test that run by default; its other cases are `slow`.
"""

from __future__ import annotations

import os
import signal
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

# A shell starts what it runs in the background (`pytest &`) deaf to Ctrl-C, and so would be all that the tests start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

TESTS = Path(__file__).resolve().parent
# Folder of tests/ -> its files, without `test_` and `.py`.
FAST = {
    ".": """
        imports public_names""",
    "contact": """
        client codec coupling facing forms half_describe half_field half_property half_slave half_state laws
        link notes service shear_history sparse call_stats traction""",
    "coupler": """
        acceleration accounts adiabatic advise branches checkpoint compare console contact_page control
        coupling description estimate events extrapolation predict rules rules_fit scenario_docs scenario_errors
        scenario_iteration scenario_laws scenario_load scenario_mesh scenario_override scenario_reading
        scenario_rules scenario_small schedule schemes stepsize contact_lines study thermal_page verify vtkhdf""",
    "mechanical_fmu": """
        augment contact_newton contact_patch elastic_contact elastic_patch elastic_spec elements_bending
        elements_locking elements_points flow_strain friction points_logstrain points_material points_melting
        points_verification rigid rod solution_dynamics solution_loads solution_melting solution_methods""",
    "stability": """
        conduction freezing rods""",
    "thermal_fmu": """
        lumped thermal_anisotropy thermal_entropy thermal_fields thermal_friction thermal_caches thermal_newton
        thermal_nonlinear thermal_rod thermal_space thermal_steady""",
}
# Each of these needs the kernels of another half first: processes that begin with them do not wait for each other.
FIRST = {
    "coupler": "plain_run",
    "mechanical_fmu": "first_contact",
    "thermal_fmu": "thermal_phase"}
# The files with more than 20 s by default, the longest of a folder first.
LONG = {
    "coupler": """
        resume report several ssp builders hosts verify_child spare own_mechanical_meshes tools agreement
        outputs processes cli restarts bind watch verdict study_run fmi""",
    ".": """
        docs notebooks""",
    "scenarios": """
        sliding_blocks aluminium_can""",
    "mechanical_fmu": """
        impact""",
    "random_scenes": """
        invariants_contact invariants_frame""",
    "thermal_fmu": """
        thermal_adaptive thermal_order""",
    "contact": """
        compiled papers zenoh half_build""",
}


def _files(names: dict[str, str]) -> list[Path]:
    return [(TESTS / folder / f"test_{name}.py").resolve() for folder, all_of in names.items()
            for name in all_of.split()]


FAST_FILES, LONG_FILES = set(_files(FAST)), [*_files(FIRST), *_files(LONG)]


@pytest.fixture(scope="module")
def unlooked() -> Iterator[None]:
    """Let runs in fixed windows estimate no errors: for files that ask nothing of them.

    To solve windows again for that is a third of what such a run costs, and changes no bit of it
    (tests/coupler/test_spare.py).  Whether the exchange is stable is looked at all the same.
    """
    from coupler.control import spare

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spare, "wanted", lambda *args, **more: False)
        yield


def pytest_configure(config: pytest.Config) -> None:
    """Keep xdist from its own order, which is that of the number of tests."""
    config.option.loadscopereorder = False


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Run one process more than there are cores: many tests wait for processes that they started."""
    return (os.cpu_count() or 1) + 1


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out the files that `-m fast` would deselect: importing them takes longer than the tests that stay."""
    if config.option.markexpr == "fast" and collection_path.suffix == ".py":
        return collection_path.resolve() not in FAST_FILES or None
    return None


def keep_few(cases: list[pytest.Item]) -> None:
    """Mark slow the cases of a test that its mark `few` does not name.  Raises CollectError for names of no case."""
    mark = cases[0].get_closest_marker("few")
    if mark is None:
        return
    case_of = {case.name.partition("[")[2].removesuffix("]"): case for case in cases}
    if unknown := set(mark.args) - case_of.keys():
        raise pytest.Collector.CollectError(f"{cases[0].name}: few names {sorted(unknown)} of {list(case_of)}")
    for name in case_of.keys() - set(mark.args):
        case_of[name].add_marker("slow")


@pytest.hookimpl(wrapper=True)
def pytest_pycollect_makeitem() -> Iterator[None]:
    """Look at each test with all of its cases, whichever of them were asked for."""
    made = yield
    if isinstance(made, list) and made:
        keep_few(made)
    return made


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of fast files that are not slow; put long files first, then those with many tests."""
    for item in items:
        if item.path.resolve() in FAST_FILES and item.get_closest_marker("slow") is None:
            item.add_marker("fast")
    many = Counter(item.path for item in items)
    place = {path: (LONG_FILES.index(path.resolve()) if path.resolve() in LONG_FILES else len(LONG_FILES), -n)
             for path, n in many.items()}
    items.sort(key=lambda item: place[item.path])
