"""The notebooks of docs run from their first cell to their last, and say what they should."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs/notebooks"
# Of each notebook a line that it prints, and the range in which its last number lies.
SAYS = {
    # Closed form: 454.37262 K (docs/cases.md, heated bars).
    "first_run": (r"the face of the hot bar is at ([\d.]+) degC", 454.37262 - 273.15 - 1e-3, 454.37262 - 273.15 + 1e-3),
    # The free expansion of the shaft is 12e-6 * 280 K * 20 mm = 67 um: a clearance of 20 um is closed.
    "own_scene": (r"at the end the fit presses with ([\d.]+) MPa", 20.0, 400.0),
    # Half the window, a quarter of the error; the line behind `staggered` says 1.
    "speed_and_accuracy": (r"extrapolated .*\n.*\n.*\n +order ([\d.]+)", 1.7, 2.6),
    # It loses heat to the air and is held off: far below the plate that stays, above its limit of 350 K.
    "write_a_half": (r"the plate that lifts ends at ([\d.]+) K", 355.0, 440.0),
}


def test_all_are_known() -> None:
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == SAYS.keys()
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert all(f"docs/notebooks/{name}.ipynb" in readme for name in SAYS)


@pytest.mark.parametrize("name", SAYS)
def test_a_notebook_is_stored_without_outputs(name: str) -> None:
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


@pytest.mark.few("write_a_half")
@pytest.mark.parametrize("name", SAYS)
@pytest.mark.filterwarnings("ignore")  # of Jupyter's own packages
def test_a_notebook_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    # gmsh imports without the libraries of the system that it needs (libGLU and others), and then can do nothing.
    if name == "own_scene" and not hasattr(pytest.importorskip("gmsh").lib, "gmshInitialize"):
        pytest.skip("gmsh lacks libraries of the system")
    # The kernel of this environment, wherever a user has installed others.
    monkeypatch.setenv("JUPYTER_PREFER_ENV_PATH", "1")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    (tmp_path / "docs/notebooks").mkdir(parents=True)
    shutil.copytree(ROOT / "scenarios", tmp_path / "scenarios")
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    client = nbclient.NotebookClient(notebook, timeout=240, kernel_name="python3",
                                     resources={"metadata": {"path": str(tmp_path / "docs/notebooks")}})
    client.execute()
    said = "".join(out.get("text", "") for cell in notebook.cells for out in cell.get("outputs", ()))
    words, least, most = SAYS[name]
    found = re.search(words, said)
    assert found is not None, said
    assert least < float(found[1]) < most, said
    if name in ("first_run", "own_scene"):  # `plot` shows its curves, not only the name of its axes
        assert any("image/png" in out.get("data", {}) and "Axes" in out["data"]["text/plain"]
                   for cell in notebook.cells for out in cell.get("outputs", ()))
