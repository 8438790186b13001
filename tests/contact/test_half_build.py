"""FMUs as built: valid, the same for the same content, carrying their packages, refused where packages differ."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest

from contact.half import build_fmu, papers

sys.path.insert(0, str(Path(__file__).parent))
from toy_halves import HALVES, build, directory, environment, fresh


@pytest.fixture(scope="module")
def fmu(tmp_path_factory) -> Path:
    return build(tmp_path_factory.mktemp("toy"))


def test_the_fmu_is_valid(fmu):
    out = fresh("import sys; from fmpy.validation import validate_fmu; print(validate_fmu(sys.argv[1]))", fmu)
    assert out.strip() == "[]"


def test_the_fmu_is_deflated_and_holds_what_it_needs(fmu):
    with zipfile.ZipFile(fmu) as archive:
        names = set(archive.namelist())
        assert {info.compress_type for info in archive.infolist()} == {zipfile.ZIP_DEFLATED}
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    identifier = root.find("CoSimulation").get("modelIdentifier")
    for name in ("modelDescription.xml", f"resources/{identifier}.py", "resources/model.json", "resources/interface.h5",
                 f"binaries/linux64/{identifier}.so", "resources/packages/contact/half/slave.py",
                 "resources/packages/toy_half/model.py", "resources/pythonfmu/fmi2slave.py"):
        assert name in names
    assert not [n for n in names if "__pycache__" in n]
    assert identifier.startswith("toy_half_")
    assert root.find("CoSimulation").get("canSerializeFMUstate") == "true"


def test_the_same_content_gives_the_same_file_and_another_gives_another_name(fmu, tmp_path, monkeypatch):
    assert build(tmp_path / "again").read_bytes() == fmu.read_bytes()
    monkeypatch.syspath_prepend(str(HALVES))
    others = built_here(tmp_path / "rate", rate=0.2), built_here(tmp_path / "mesh", n=5)
    assert len({guid(path) for path in (fmu, *others)}) == 3


@pytest.mark.parametrize(("name", "other"), [("requirements", ["h5py==0"]),
                                             ("origin_of", papers.Origin("toy", "9", "MIT"))])
def test_what_it_needs_and_where_it_is_from_are_in_its_name(fmu, tmp_path, name, other, monkeypatch):
    """Two files of one guid are one file."""
    monkeypatch.syspath_prepend(str(HALVES))
    assert built_here(tmp_path / "same").read_bytes() == fmu.read_bytes()
    monkeypatch.setattr(papers, name, lambda *_: other)
    out = built_here(tmp_path / "other")
    assert out.read_bytes() != fmu.read_bytes()
    assert guid(out) != guid(fmu)


def built_here(folder: Path, n: int = 4, **model: object) -> Path:
    """The FMU of a toy half, built in this process."""
    return build_fmu(directory(folder, n, **model), folder / "toy.fmu", package="toy_half",
                     load="toy_half.model:load")


def guid(path: Path) -> str:
    with zipfile.ZipFile(path) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml")).get("guid")


@pytest.mark.few("<lambda>-interface.h5_0")
@pytest.mark.parametrize(("spoil", "match"), [
    (lambda d: (d / "model.json").unlink(), "model.json"),
    (lambda d: (d / "model.json").write_text('{"half": "other"}'), "not 'toy'"),
    (lambda d: (d / "interface.h5").write_bytes(b"no"), "interface.h5"),
    (lambda d: (d / "interface.h5").unlink(), "interface.h5")])
def test_a_wrong_directory_ends_the_builder_with_2_and_one_line(tmp_path, spoil, match):
    spoil(directory(tmp_path))
    done = subprocess.run([sys.executable, "-P", "-m", "toy_half.build", str(tmp_path), str(tmp_path / "x.fmu")],
                          capture_output=True, text=True, env=environment(), timeout=240, check=False)
    assert done.returncode == 2
    assert match in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(p.suffix for p in tmp_path.iterdir() if p.suffix not in (".h5", ".json")) == []


LOAD = """
    import sys
    from pathlib import Path
    {before}
    from coupler.fmu.fmi import load_half
    from coupler.errors import HalfError
    try:
        half = load_half(Path(sys.argv[1]), Path(sys.argv[2]), "toy")
    except HalfError as exc:
        print("refused:", exc)
    else:
        half.initialise(0.0, 1.0, {{}}, {{}}, [])
        print(sys.modules["toy_half.model"].__file__, sys.modules["contact"].__file__)
    print("path:", [p for p in sys.path if "resources" in p])
"""


def test_installed_packages_of_the_same_sources_are_used(fmu, tmp_path):
    out = fresh(LOAD.format(before=""), fmu, tmp_path / "fmu")
    assert str(HALVES / "toy_half" / "model.py") in out
    assert "resources" not in out.splitlines()[0]
    assert out.splitlines()[1] == "path: []", "the search path of the host stays clean"


def test_without_the_package_the_fmu_brings_its_own(fmu, tmp_path):
    root = str(HALVES.parent.parent.parent)
    out = fresh(LOAD.format(before=""), fmu, tmp_path / "fmu", env=environment(PYTHONPATH=root))
    assert str(tmp_path / "fmu" / "resources" / "packages" / "toy_half" / "model.py") in out


EDITED = """
    import subprocess, sys
    from pathlib import Path
    from coupler.fmu.fmi import load_half
    from coupler.errors import HalfError
    folder, scene, source = Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3])
    for n in (1, 2):
        fmu = folder / f"{n}.fmu"
        subprocess.run([sys.executable, "-m", "toy_half.build", str(scene), str(fmu)], check=True)
        try:
            load_half(fmu, folder / str(n), "toy")
            print("loaded", n)
        except HalfError as exc:
            print("refused:", exc)
        source.write_text(source.read_text() + "\\n# edited\\n")
"""


@pytest.mark.slow
def test_sources_edited_since_they_were_loaded_are_refused(tmp_path):
    """As by who edits a half in an editor and runs it again in the same notebook: the old one was run, in silence."""
    other = tmp_path / "other" / "toy_half"
    shutil.copytree(HALVES / "toy_half", other)
    env = environment()
    env["PYTHONPATH"] = f"{other.parent}:{env['PYTHONPATH']}"
    out = fresh(EDITED, tmp_path, directory(tmp_path / "scene"), other / "model.py", env=env)
    assert "loaded 1" in out
    assert "already loaded another 'toy_half'" in out


def test_other_sources_already_loaded_are_refused_by_name(fmu, tmp_path):
    other = tmp_path / "other" / "toy_half"
    other.mkdir(parents=True)
    for path in (HALVES / "toy_half").glob("*.py"):
        (other / path.name).write_text(path.read_text() + "\n# another version\n")
    env = environment()
    env["PYTHONPATH"] = f"{other.parent}:{env['PYTHONPATH']}"
    out = fresh(LOAD.format(before="import toy_half"), fmu, tmp_path / "fmu", env=env)
    assert "refused: half 'toy'" in out
    assert "already loaded another 'toy_half'" in out
    assert "process of its own" in out
    unloaded = fresh(LOAD.format(before=""), fmu, tmp_path / "fmu", env=env)
    assert str(tmp_path / "fmu" / "resources") in unloaded, "installed but not loaded: the FMU's own copy serves"
