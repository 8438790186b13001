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
             "return 2.0 * np.pi * max(r_1", "return max(r_1",
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
    Mutation("volumetric term of the tangent with the wrong sign", "mechanical_fmu/kernels.py",
             "close_tangent(kappa[e] * (1.0 - log)",
             "close_tangent(kappa[e] * (1.0 + log)",
             ("tests/mechanical_fmu/test_elastic_patch.py",)),
    Mutation("isochoric exponent wrong", "mechanical_fmu/kernels.py",
             "c = w * mu[e] * J[q] ** (-2.0 / 3.0)",
             "c = w * mu[e] * J[q] ** (-1.0 / 3.0)",
             ("tests/mechanical_fmu/test_elastic_patch.py",)),
    Mutation("hoop stretch left out of the forces", "mechanical_fmu/kernels.py",
             "h[a, 0] = g[a, 0] + hoop / F[q, 4]",
             "h[a, 0] = g[a, 0]",
             ("tests/mechanical_fmu/test_elastic_patch.py",)),
    Mutation("a term of the tangent with the wrong sign", "mechanical_fmu/kernels.py",
             "add_tangent(B[e, q], N_over_R[e, q], F[q, 4], c, -s,",
             "add_tangent(B[e, q], N_over_R[e, q], F[q, 4], c, s,",
             ("tests/mechanical_fmu/test_elastic_patch.py",)),
    Mutation("thermal strain once instead of three times", "mechanical_fmu/material.py",
             "e_th[here] = 3.0 * np.log(stretch)",
             "e_th[here] = np.log(stretch)",
             ("tests/mechanical_fmu/test_elastic_patch.py",)),
    Mutation("bulk modulus of plane stress", "mechanical_fmu/material.py",
             "kappa[here] = E / (3.0 * (1.0 - 2.0 * material.nu))",
             "kappa[here] = E / (3.0 * (1.0 - material.nu))",
             ("tests/mechanical_fmu/test_elastic_cylinder.py",)),
    Mutation("2 pi R dropped from the cells", "mechanical_fmu/elements.py",
             "(2.0 * np.pi * R if interface.axisymmetric else 1.0)",
             "(R if interface.axisymmetric else 1.0)",
             ("tests/mechanical_fmu/test_elastic_cylinder.py",)),
    Mutation("pressure pulls", "mechanical_fmu/loads.py",
             "return -p[:, None, None]",
             "return p[:, None, None]",
             ("tests/mechanical_fmu/test_elastic_cylinder.py",)),
    Mutation("follower pressure does not turn in the tangent", "mechanical_fmu/loads.py",
             "dn = np.stack([-TURN, TURN])",
             "dn = 0.0 * np.stack([-TURN, TURN])",
             ("tests/mechanical_fmu/test_elastic_patch.py",)),
    Mutation("predictor leaves driven bodies behind", "mechanical_fmu/constraints.py",
             "mean = (total / np.maximum(n, 1)).reshape(-1, 2)",
             "mean = 0.0 * (total / np.maximum(n, 1)).reshape(-1, 2)",
             ("tests/mechanical_fmu/test_elastic_patch.py",)),
    Mutation("jumps seen from the right", "mechanical_fmu/elastic_model.py",
             "self._loading(inputs, t + h, -1,",
             "self._loading(inputs, t + h, 1,",
             ("tests/mechanical_fmu/test_elastic_patch.py",)),
    Mutation("prescribed displacement unfactored", "mechanical_fmu/constraints.py",
             "numbers = [s.at(t, side) * (factors[n] if n else 1.0)",
             "numbers = [s.at(t, side)",
             ("tests/mechanical_fmu/test_elastic_patch.py",)),
    Mutation("contact forces halved", "mechanical_fmu/system.py",
             "external += self.contact.force(tractions)",
             "external += 0.5 * self.contact.force(tractions)",
             ("tests/mechanical_fmu/test_elastic_contact.py",)),
    Mutation("contact stiffness left out of the fresh tangent", "mechanical_fmu/tangent.py",
             "K = K + system.contact.matrix(balance.tractions)",
             "pass",
             ("tests/mechanical_fmu/test_elastic_contact.py",)),
    Mutation("springs never taken out again", "mechanical_fmu/tangent.py",
             "E = np.diag(-self.springs)",
             "E = np.diag(0.0 * self.springs)",
             ("tests/mechanical_fmu/test_elastic_contact.py",)),
    Mutation("an old factor used whatever the state says", "mechanical_fmu/elastic_model.py",
             "key = state.anchor_u.tobytes() + state.anchor_T.tobytes()",
             'key = b""',
             ("tests/mechanical_fmu/test_elastic_contact.py",)),
    Mutation("tolerance of a body measured by the other", "mechanical_fmu/system.py",
             "return np.sqrt(squares[1:])",
             "return np.sqrt(squares[1:]) * [1.0, 0.0][:len(squares) - 1]",
             ("tests/mechanical_fmu/test_elastic_contact.py",)),
    Mutation("loose bodies not looked for", "mechanical_fmu/tangent.py",
             "if values[0] <= LOOSE * values[-1] or values[-1] <= 0.0:",
             "if values[0] > 1e300:",
             ("tests/mechanical_fmu/test_elastic_patch.py",)),
    Mutation("disagreeing prescriptions taken", "mechanical_fmu/constraints.py",
             "if first != i and not _same(displacements[first], d):",
             "if first != i and first < 0:",
             ("tests/mechanical_fmu/test_elastic_spec.py",)),
    Mutation("rigid pressure on the slave only", "mechanical_fmu/rigid_model.py",
             "for n in (pair.slave, pair.master)]",
             "for n in (pair.slave,)]",
             ("tests/mechanical_fmu/test_rigid.py",)),
    Mutation("rigid pressure without touching", "mechanical_fmu/rigid_model.py",
             "if p > 0.0 and met.size and met.min() <= TOUCH:",
             "if p > 0.0 and met.size:",
             ("tests/mechanical_fmu/test_rigid.py",)),
    Mutation("temperatures not converted", "coupler/scenario/convert.py",
             "return T + self.offset",
             "return T",
             ("tests/coupler/test_scenario_load.py",)),
    Mutation("every signal shifted to kelvin", "coupler/scenario/convert.py",
             "return self._mapped(spec, key, check)",
             "return self._mapped(spec, key, self.kelvin)",
             ("tests/coupler/test_scenario_load.py",)),
    Mutation("unused signals make kinks", "coupler/scenario/timing.py",
             "kinks_in(models))",
             "kinks_in(models), 7.0)",
             ("tests/coupler/test_scenario_load.py",)),
    Mutation("gap in the windows unseen", "coupler/scenario/timing.py",
             "if start < end * (1 - SAME):",
             "if start < 0.5 * end:",
             ("tests/coupler/test_scenario_errors.py",)),
    Mutation("windows may go backwards", "coupler/scenario/timing.py",
             "if until <= before:",
             "if until < 0.0:",
             ("tests/coupler/test_scenario_errors.py",)),
    Mutation("top surface runs the wrong way", "coupler/scenario/rectangle.py",
             '"top": (0, True, True,',
             '"top": (0, True, False,',
             ("tests/coupler/test_scenario_mesh.py",)),
    Mutation("lines of mesh files not turned", "coupler/scenario/mesh_file.py",
             "np.where(turned[:, None], line[:, ::-1], line)[on]",
             "line[on]",
             ("tests/coupler/test_scenario_mesh.py",)),
    Mutation("clockwise cells kept", "coupler/scenario/body_mesh.py",
             "np.where(sign[:, None] < 0, cells[:, ::-1], cells)",
             "cells",
             ("tests/coupler/test_scenario_mesh.py",)),
    Mutation("unit of a mesh file ignored", "coupler/scenario/mesh_file.py",
             " * METRES[spec.unit]",
             "",
             ("tests/coupler/test_scenario_mesh.py",)),
    Mutation("probe takes the first node of its cell", "coupler/scenario/locate.py",
             "return nodes[kept], weights[kept] / weights[kept].sum()",
             "return nodes[kept][:1], np.ones(1)",
             ("tests/coupler/test_scenario_probes.py",)),
    Mutation("mean of a surface without its areas", "coupler/scenario/probes.py",
             "share = length[:, None] * (2 * r + r[:, ::-1]) / 6",
             "share = 1.0 + 0.0 * r",
             ("tests/coupler/test_scenario_probes.py",)),
    Mutation("mean over a disc as over a strip", "coupler/scenario/probes.py",
             "ends[:, :, 0] if interface.axisymmetric else",
             "0.0 * ends[:, :, 0] + 1.0 if interface.axisymmetric else",
             ("tests/coupler/test_scenario_probes.py",)),
    Mutation("unknown keys accepted", "coupler/scenario/base.py",
             "if key not in cls.model_fields:",
             "if False:",
             ("tests/coupler/test_scenario_override.py",)),
    Mutation("overrides change nothing", "coupler/scenario/override.py",
             "            node[part] = value\n",
             "            pass\n",
             ("tests/coupler/test_scenario_override.py",)),
    Mutation("aliases without limit", "coupler/scenario/reading.py",
             "if len(_ALIAS.findall(text)) > MAX_ALIASES:",
             "if False:",
             ("tests/coupler/test_scenario_reading.py",)),
    Mutation("files of any size read", "coupler/scenario/reading.py",
             "data = stream.read(MAX_BYTES + 1)",
             "data = stream.read(MAX_BYTES)",
             ("tests/coupler/test_scenario_reading.py",)),
    Mutation("penalty from the stiffer body", "coupler/scenario/scene.py",
             "return min(stiffness) / h",
             "return max(stiffness) / h",
             ("tests/coupler/test_scenario_load.py",)),
    Mutation("absolute zero unguarded", "coupler/scenario/convert.py",
             "if T + self.offset < 0:",
             "if False:",
             ("tests/coupler/test_scenario_errors.py",)),
    Mutation("tables of conductance left in degC", "coupler/scenario/thermal_model.py",
             'if law.get("variable") == "T":',
             "if False:",
             ("tests/coupler/test_scenario_laws.py",)),
    Mutation("hash of the text, not of the mesh", "coupler/scenario/load.py",
             "if body.mesh.file is not None:",
             "if False:",
             ("tests/coupler/test_scenario_mesh.py",)),
    Mutation("fields by count forgotten", "coupler/scenario/output.py",
             "number % self.every == 0",
             "number % self.every == 1",
             ("tests/coupler/test_scenario_load.py",)),
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
