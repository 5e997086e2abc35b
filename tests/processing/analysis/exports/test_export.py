"""Droplets in formats of other programs, read by readers that are not ours."""

import csv
import json
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import DropletFileError, read_droplets, write_droplets
from processing.analysis.droplets.droplet_table import Droplets
from processing.analysis.exports.export import Export, export_droplets
from processing.analysis.exports.parquet_file import MissingLibraryError

KINDS = [kind.value for kind in Export]


def droplets(n: int, seed: int) -> Droplets:
    rng = np.random.default_rng(seed)
    points_mm, roots = rng.normal(size=(n, 3)), rng.normal(size=(n, 3, 3))
    return Droplets(
        points_mm, roots @ roots.swapaxes(1, 2), rng.random(n), rng.random(n), np.full(n, 4), rng.random(n),
        np.full(n, np.nan),
    )  # fmt: skip


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Five droplets in exposure A, three in B."""
    path = tmp_path / "shot_00007_droplets.h5"
    write_droplets(path, {"a": droplets(5, 1), "b": droplets(3, 2)}, {"run": "spray", "shot": 7})
    return path


@pytest.fixture
def empty(tmp_path: Path) -> Path:
    """A shot without droplets."""
    path = tmp_path / "shot_00008_droplets.h5"
    write_droplets(path, {"a": Droplets.none()}, {"run": "spray", "shot": 8})
    return path


def without_p_real(columns: dict[str, Any]) -> dict[str, Any]:
    return {name: column for name, column in columns.items() if name != "p_real"}


def test_csv_has_every_digit_and_no_nan(file: Path) -> None:
    path = export_droplets(file, "csv")
    assert path.name == "shot_00007_droplets.csv"
    with path.open(newline="") as text:
        rows = list(csv.DictReader(text))
    stored = read_droplets(file).columns
    assert list(rows[0]) == ["shot", *stored]
    assert {row["shot"] for row in rows} == {"7"}
    assert {row["p_real"] for row in rows} == {""}
    assert [row["frame"] for row in rows] == list("aaaaabbb")
    for name, column in without_p_real(stored).items():
        if name != "frame":
            assert [float(row[name]) for row in rows] == column.tolist(), name


def test_parquet_keeps_columns_types_and_provenance(file: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed, extra [tables]")
    table = parquet.read_table(export_droplets(file, "parquet"))
    stored = read_droplets(file)
    assert table.column_names == ["shot", *stored.columns]
    for name, column in without_p_real(stored.columns).items():
        assert table[name].to_pylist() == column.tolist(), name
    assert [str(table.schema.field(name).type) for name in ("shot", "frame", "x_mm", "views")] == [
        "int64", "string", "double", "int64"
    ]  # fmt: skip
    assert json.loads(table.schema.metadata[b"tomoshadow"]) == stored.provenance


def test_without_pyarrow_the_remedy_is_named(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingLibraryError, match=r"pip install 'tomoshadow\[tables\]', or export csv"):
        export_droplets(file, "parquet")
    assert not file.with_suffix(".parquet").exists()


def test_vtk_reads_points_and_arrays(file: Path) -> None:
    reader = pytest.importorskip("vtkmodules.vtkIOHDF", reason="vtk is not installed").vtkHDFReader()
    numpy_support = pytest.importorskip("vtkmodules.util.numpy_support")
    reader.SetFileName(str(export_droplets(file, "vtk")))
    reader.Update()
    points, stored = reader.GetOutput(), read_droplets(file).columns
    assert (points.GetNumberOfPoints(), points.GetNumberOfVerts(), points.GetNumberOfCells()) == (8, 8, 8)
    xyz = numpy_support.vtk_to_numpy(points.GetPoints().GetData())
    np.testing.assert_array_equal(xyz, np.column_stack([stored[f"{axis}_mm"] for axis in "xyz"]))
    arrays = points.GetPointData()
    for name in ("amplitude", "residual", "cov_xz_mm2"):
        np.testing.assert_array_equal(numpy_support.vtk_to_numpy(arrays.GetArray(name)), stored[name])
    assert numpy_support.vtk_to_numpy(arrays.GetArray("exposure")).tolist() == [0] * 5 + [1] * 3


@pytest.mark.parametrize("n", [8, 0])
def test_vtkhdf_is_as_its_specification_has_poly_data(file: Path, empty: Path, n: int) -> None:
    """Groups, types and lengths of docs.vtk.org, VTKHDF file format, PolyData: all kinds of cells must be there."""
    with h5py.File(export_droplets(file if n else empty, "vtk")) as written:
        poly = written["VTKHDF"]
        assert poly.attrs["Type"] == b"PolyData"
        assert poly.attrs.get_id("Type").get_type().is_variable_str() is False
        assert poly.attrs["Version"].tolist() == [2, 0]
        assert poly["NumberOfPoints"][:].tolist() == [n]
        assert poly["Points"].shape == (n, 3)
        for cells, count in {"Vertices": n, "Lines": 0, "Polygons": 0, "Strips": 0}.items():
            assert poly[cells]["NumberOfCells"][:].tolist() == [count]
            assert poly[cells]["NumberOfConnectivityIds"][:].tolist() == [count]
            assert poly[cells]["Offsets"][:].tolist() == list(range(count + 1))
            assert poly[cells]["Connectivity"][:].tolist() == list(range(count))
        assert {array.shape for array in poly["PointData"].values()} == {(n,)}
        assert written["tomoshadow"].attrs["run"] == "spray"


def test_a_shot_without_droplets_is_a_table_without_rows(empty: Path) -> None:
    text = export_droplets(empty, "csv").read_text().splitlines()
    assert len(text) == 1
    assert text[0].startswith("shot,frame,x_mm")
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed, extra [tables]")
    schema = parquet.read_table(export_droplets(empty, "parquet")).schema
    assert [str(schema.field(name).type) for name in ("frame", "x_mm")] == ["string", "double"]


def test_an_export_that_cannot_be_written_leaves_the_old_one(file: Path) -> None:
    export_droplets(file, "vtk").write_text("old")
    with h5py.File(file, "a") as stored:
        del stored["droplets/z_mm"]
    with pytest.raises(DropletFileError, match="droplets without z_mm have no place in space; export csv"):
        export_droplets(file, "vtk")
    assert file.with_suffix(".vtkhdf").read_text() == "old"
