"""Named breaks of the code, each of which must turn a test red: `python tests/mutations.py [NAME ...]`.

The packages are copied to a scratch folder, one line is broken there, and the tests named with it run on the copy.
A break that no test notices is a hole in the tests; the command then exits with 1.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("contact", "thermal_fmu", "mechanical_fmu", "coupler")


@dataclass(frozen=True)
class Mutation:
    """In `file`, `old` (which stands there once) becomes `new`; one of `tests` (pytest arguments) must fail."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


MUTATIONS: tuple[Mutation, ...] = (
    Mutation("window-time lag: extrapolation to the end instead of the middle", "coupler/window.py",
             "geometry_at(scheme, state.now, state.before, 0.5 * (t0 + t1))",
             "geometry_at(scheme, state.now, state.before, t1)", ("tests/coupler/test_coupling.py",)),
    Mutation("extrapolation switched off", "coupler/level.py", "w = (t - now.t) / (now.t - before.t)", "w = 0.0",
             ("tests/coupler/test_coupling.py",)),
    Mutation("mechanical heat delivered twice", "coupler/window.py", "state.account.carry * ((t1 - t0) / H)",
             "state.account.carry", ("tests/coupler/test_coupling.py",)),
    Mutation("halves not put back after a discard", "coupler/control.py", "half.restore(token)", "pass",
             ("tests/coupler/test_coupling.py",)),
    Mutation("areas not clipped at the master's end", "contact/geometry.py",
             "hit = -SLIVER <= xi_m <= 1.0 + SLIVER and", "hit = -0.5 <= xi_m <= 1.5 and",
             ("tests/contact/test_facing.py",)),
    Mutation("slave edges cut at some of the master's nodes only", "contact/geometry.py",
             "if 0.0 < xi < 1.0:", "if 0.4 < xi < 0.6:",
             ("tests/contact/test_facing.py",)),
    Mutation("2 pi r dropped from the areas", "contact/geometry.py",
             "r = 2.0 * np.pi * max(x1[0]", "r = 1.0 * max(x1[0]",
             ("tests/contact/test_facing.py",)),
    Mutation("master pieces weighted as if the map were linear", "contact/geometry.py",
             "if t0 < m1 / m0 < t1:", "if t0 < m1 / m0 < t0:",
             ("tests/contact/test_facing.py",)),
    Mutation("the farther of two master edges met", "contact/geometry.py",
             "abs(g) < abs(best) - slack", "abs(g) > abs(best) + slack",
             ("tests/contact/test_facing.py",)),
    Mutation("normals jump from edge to edge", "contact/normals.py",
             "if other >= 0 and nx", "if other < -1 and nx",
             ("tests/contact/test_facing.py",)),
    Mutation("normals averaged round square corners", "contact/normals.py",
             "CORNER_COS = 0.5", "CORNER_COS = -0.5",
             ("tests/contact/test_facing.py",)),
    Mutation("covered share by the other node's shape function", "contact/facing.py",
             "faced[a] += (1.0 - values[i, side])", "faced[a] += values[i, side]",
             ("tests/contact/test_facing.py",)),
    Mutation("master pushed less than the slave", "contact/traction.py",
             "sign = -1.0 if side == 0 else 1.0", "sign = -1.0 if side == 0 else 0.999",
             ("tests/contact/test_traction.py",)),
    Mutation("contact may pull", "contact/traction.py",
             "max(-given - eps_N[i] * values[i, 2], 0.0)", "-given - eps_N[i] * values[i, 2]",
             ("tests/contact/test_traction.py",)),
    Mutation("sliding along a tilted master edge forgotten", "contact/traction.py",
             "K * n_y * n_m[0]", "K * n_y * n_x",
             ("tests/contact/test_traction.py",)),
    Mutation("negative gaps reach the law", "contact/laws.py",
             "np.maximum(g_, 0.0)", "g_",
             ("tests/contact/test_laws.py",)),
    Mutation("gap factor as misprinted in the paper", "contact/laws.py",
             "(np.asarray(g, dtype=float) - d_cut)", "(np.asarray(g, dtype=float) - d_full)",
             ("tests/contact/test_laws.py",)),
)


def broken_copy(mutation: Mutation, target: Path) -> None:
    """Copy the packages to target and break one line.  Raises ValueError where the line is not there once."""
    for name in (*PACKAGES, "tests", "scenarios"):
        shutil.copytree(ROOT / name, target / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", target)
    path = target / mutation.file
    text = path.read_text(encoding="utf-8")
    if text.count(mutation.old) != 1:
        raise ValueError(f"{mutation.name}: the line stands {text.count(mutation.old)} times in {mutation.file}")
    path.write_text(text.replace(mutation.old, mutation.new), encoding="utf-8")


def is_noticed(mutation: Mutation) -> bool:
    """Whether a test fails on the broken copy."""
    with tempfile.TemporaryDirectory() as scratch:
        target = Path(scratch)
        broken_copy(mutation, target)
        env = {**os.environ, "PYTHONPATH": str(target), "SLIDELINE_CACHE": str(target / "cache"),
               "NUMBA_CACHE_DIR": str(target / "numba")}
        done = subprocess.run([sys.executable, "-m", "pytest", "-x", "-q", "-m", "", "-p", "no:cacheprovider",
                               *mutation.tests], cwd=target, env=env, capture_output=True, text=True, check=False)
        if done.returncode not in (0, 1):
            raise RuntimeError(f"{mutation.name}: pytest ended with {done.returncode}\n{done.stdout}{done.stderr}")
        return done.returncode == 1


def main(names: list[str]) -> int:
    """Run the breaks whose name contains one of `names` (all where none is given)."""
    unnoticed = 0
    for mutation in MUTATIONS:
        if names and not any(n in mutation.name for n in names):
            continue
        noticed = is_noticed(mutation)
        unnoticed += not noticed
        print(f"{'red' if noticed else 'NOT NOTICED':12} {mutation.name}", flush=True)
    return 1 if unnoticed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
