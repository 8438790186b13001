"""Compiled code is made anew when any file it was compiled from changes."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
ASK = """
import numpy as np
from mechanical_fmu.hardening import flow_stress
p = np.zeros(21)
p[3], p[19] = 3.0, 19.0
print(flow_stress(p, np.empty(0), 1.0)[0])
"""


def test_a_change_of_a_constant_in_another_file_is_seen(tmp_path):
    for package in ("mechanical_fmu", "contact"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    env = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "numba")}

    def answer():
        # -c would put the working directory first on the path.
        done = subprocess.run([sys.executable, "-c", ASK], env=env, cwd=tmp_path, capture_output=True, text=True,
                              check=True)
        return float(done.stdout)

    assert answer() == 3.0
    layout = tmp_path / "mechanical_fmu/point_layout.py"
    text = layout.read_text(encoding="utf-8")
    layout.write_text(text + "\nP_YIELD = 19\n", encoding="utf-8")
    assert answer() == 19.0
