"""The field files: what h5py sees of the layout, and what VTK's own reader (ParaView's) makes of them."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from coupler.errors import ResultsError
from coupler.record.vtkhdf import FieldReader

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import Case, blocks, level, times_of, write_run

CASE = Case(windows=6, frames=7, n=4, reject=0)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return write_run(tmp_path_factory.mktemp("fields") / "run.h5", CASE).field_files


def test_layout_is_the_one_vtk_describes(files: dict[str, Path]) -> None:
    scene, n = blocks(CASE.n), CASE.windows + 1
    points, cells = len(scene.nodes), len(scene.quads) + len(scene.triangles)
    with h5py.File(files["mechanical"]) as f:
        root, steps = f["VTKHDF"], f["VTKHDF/Steps"]
        assert root.attrs["Type"] == b"UnstructuredGrid"
        assert root.attrs["Version"].tolist() == [2, 0]
        assert int(steps.attrs["NSteps"]) == n
        assert [root[k][()].tolist() for k in ("NumberOfPoints", "NumberOfCells")] == [[points], [cells]]
        assert root["NumberOfConnectivityIds"][()].tolist() == [root["Connectivity"].size]
        assert root["Offsets"][-1] == root["Connectivity"].size
        assert root["Types"][()].tolist() == [9] * len(scene.quads) + [5] * len(scene.triangles)
        assert root["Points"].shape == (n * points, 3)
        assert steps["Values"][()].tolist() == times_of(CASE).tolist()
        assert steps["PointOffsets"][()].tolist() == [k * points for k in range(n)]
        assert steps["NumberOfParts"][()].tolist() == [1] * n
        for name in ("PartOffsets", "CellOffsets", "ConnectivityIdOffsets", "CellDataOffsets/body"):
            assert steps[name].shape[0] == n
            assert not steps[name][()].any(), f"{name}: the connectivity is stored once"
        assert steps["CellDataOffsets/sigma_v"][()].tolist() == [k * cells for k in range(n)]
        assert steps["PointDataOffsets/u"][()].tolist() == [k * points for k in range(n)]


@pytest.mark.parametrize("frame", [0, 4, 6])
def test_reader_gives_back_the_frames(files: dict[str, Path], frame: int) -> None:
    scene = blocks(CASE.n)
    expected = level(scene, float(times_of(CASE)[frame]))
    with FieldReader(files["thermal"]) as f:
        assert f.times.tolist() == times_of(CASE).tolist()
        assert np.array_equal(f.point_field("T", frame), expected.T)
        assert np.array_equal(f.points(frame), expected.x)
        assert np.array_equal(f.quads, scene.quads)
        assert np.array_equal(f.triangles, scene.triangles)
        assert np.array_equal(f.cell_field("body", frame), np.append(scene.quad_body, scene.triangle_body))


def test_a_foreign_file_is_refused_by_name(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.vtkhdf", "w") as f:
        f["VTKHDF/Other"] = 1
    for name in ("a.vtkhdf", "none.vtkhdf"):
        with pytest.raises(ResultsError, match=name):
            FieldReader(tmp_path / name)


@pytest.mark.parametrize("frame", [0, 4, 6])
def test_vtk_reads_every_step_by_value(files: dict[str, Path], frame: int) -> None:
    vtk_io = pytest.importorskip("vtkmodules.vtkIOHDF", reason="VTK is not installed")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    scene = blocks(CASE.n)
    t = float(times_of(CASE)[frame])
    expected, s = level(scene, t), scene.contact_nodes
    read = {}
    for half, file in files.items():
        reader = vtk_io.vtkHDFReader()
        reader.SetFileName(str(file))
        reader.UpdateInformation()
        info = reader.GetOutputInformation(0)
        steps = [info.Get(reader.GetExecutive().TIME_STEPS(), k)
                 for k in range(info.Length(reader.GetExecutive().TIME_STEPS()))]
        assert steps == times_of(CASE).tolist()
        reader.UpdateTimeStep(t)
        read[half] = reader.GetOutput()
    grid = read["mechanical"]
    points = vtk_to_numpy(grid.GetPoints().GetData())
    assert np.array_equal(points, np.column_stack([expected.x, np.zeros(len(expected.x))]))
    data = {grid.GetPointData().GetArrayName(k): vtk_to_numpy(grid.GetPointData().GetArray(k))
            for k in range(grid.GetPointData().GetNumberOfArrays())}
    assert set(data) == {"u", "p", "gap"}
    assert np.array_equal(data["u"][:, :2], expected.x - scene.nodes)
    assert np.array_equal(data["p"][s], -expected.t_N)
    assert np.array_equal(data["gap"][s], expected.gap)
    assert np.isnan(np.delete(data["gap"], s)).all()
    cells = {n: vtk_to_numpy(grid.GetCellData().GetArray(n)) for n in ("body", "sigma_v")}
    assert cells["body"].tolist() == [*scene.quad_body, *scene.triangle_body]
    count = len(cells["body"])
    expected_stress = -float(expected.t_N.min()) * (1 + 0.1 * np.arange(count)) if frame else np.zeros(count)
    assert np.array_equal(cells["sigma_v"], expected_stress)
    assert np.array_equal(vtk_to_numpy(read["thermal"].GetPointData().GetArray("T")), expected.T)
    nodes = [tuple(grid.GetCell(k).GetPointId(i) for i in range(grid.GetCell(k).GetNumberOfPoints()))
             for k in range(count)]
    assert nodes == [tuple(c) for c in (*scene.quads.tolist(), *scene.triangles.tolist())]
