"""Droplets and tracks in formats of other programs, read by readers that are not ours."""

import csv
import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from pyarrow import parquet
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkIOGeometry import vtkTecplotReader
from vtkmodules.vtkIOHDF import vtkHDFReader

from processing.analysis.droplets.droplet_file import DropletFileError, read_droplets, write_columns, write_droplets
from processing.analysis.droplets.droplet_table import Droplets
from processing.analysis.exports.export import Export, export_droplets, export_tracks
from processing.analysis.exports.parquet_file import MissingLibraryError
from processing.analysis.velocity.track_file import read_tracks, write_tracks
from processing.analysis.velocity.track_table import DropletTracks
from tests.support.tecplot import tecplot_zones

KINDS = [kind.value for kind in Export]


def droplets(n: int, seed: int) -> Droplets:
    rng = np.random.default_rng(seed)
    points_mm, roots = rng.normal(size=(n, 3)), rng.normal(size=(n, 3, 3))
    return Droplets(
        points_mm, roots @ roots.swapaxes(1, 2), rng.random(n), rng.random(n), np.full(n, 4), rng.random(n),
        np.full(n, np.nan),
    )  # fmt: skip


DOUBT = 'droplets explain "1.3" times the noise, limit 1.25: ZONE by zone?'
EXPOSURES = {"a": {"verdict": "good", "reasons": []}, "b": {"verdict": "doubtful", "reasons": [DOUBT]}}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Five droplets in exposure A, three in B."""
    path = tmp_path / "shot_00007_droplets.h5"
    told: dict[str, str | int | float] = {"run": "spray", "shot": 7, "exposures": json.dumps(EXPOSURES)}
    write_droplets(path, {"a": droplets(5, 1), "b": droplets(3, 2)}, told)
    return path


@pytest.fixture
def empty(tmp_path: Path) -> Path:
    """A shot without droplets."""
    path = tmp_path / "shot_00008_droplets.h5"
    write_droplets(path, {"a": Droplets.none()}, {"run": "spray", "shot": 8})
    return path


@pytest.fixture
def tracks(tmp_path: Path) -> Path:
    """Two tracks of three and four droplets, without motion and link where they begin."""
    rng, path = np.random.default_rng(5), tmp_path / "tracks.h5"
    columns = {
        "track": np.array([0, 0, 0, 1, 1, 1, 1]),
        "shot": np.array([3, 4, 6, 3, 4, 5, 6]),
        **{name: rng.normal(size=7) for name in ("x_mm", "y_mm", "z_mm", "u_m_s")},
        "p_link": np.where([0, 1, 1, 0, 1, 1, 1], rng.random(7), np.nan),
    }
    write_tracks(path, DropletTracks(columns, 2, 9, 2000.0, None), {"run": 'a "spray"'})
    return path


def without_p_real(columns: dict[str, Any]) -> dict[str, Any]:
    return {name: column for name, column in columns.items() if name != "p_real"}


@pytest.mark.parametrize("read", [read_droplets, lambda path: export_droplets(path, "csv")], ids=["read", "exported"])
@pytest.mark.parametrize("edited", ["droplets/x_mm", "tomoshadow"])
def test_a_file_that_was_edited_is_refused(file: Path, read: Callable[[Path], object], edited: str) -> None:
    read(file)
    with h5py.File(file, "r+") as stored:
        if edited == "tomoshadow":
            stored[edited].attrs["shot"] = 9
        else:
            stored[edited][0] += 0.01
    with pytest.raises(DropletFileError, match=f"{file.name}: was changed after it had been measured"):
        read(file)
    with h5py.File(file, "r+") as stored:
        del stored["tomoshadow"].attrs["seal_sha256"]
    read(file)


def test_csv_has_every_digit_and_no_nan(file: Path) -> None:
    path = export_droplets(file, "csv")
    assert path.name == "shot_00007_droplets.csv"
    with path.open(newline="") as text:
        rows = list(csv.DictReader(text))
    stored = read_droplets(file).columns
    assert list(rows[0]) == ["shot", *stored, "verdict", "doubts"]
    assert [(row["verdict"], row["doubts"]) for row in rows] == [("good", "")] * 5 + [("doubtful", DOUBT)] * 3
    assert {row["shot"] for row in rows} == {"7"}
    assert {row["p_real"] for row in rows} == {""}
    assert [row["frame"] for row in rows] == list("aaaaabbb")
    for name, column in without_p_real(stored).items():
        if name != "frame":
            assert [float(row[name]) for row in rows] == column.tolist(), name


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as text:
        return list(csv.DictReader(text))


def test_csv_tells_the_verdict_of_an_exposure_that_has_no_droplet(tmp_path: Path, empty: Path) -> None:
    """In a row without numbers, behind those of droplets."""
    exposures = {"a": {"verdict": "refused", "reasons": ["no light"]}, "b": {"verdict": "good", "reasons": []}}
    for seen in (0, 3):
        path = tmp_path / f"shot_{seen:05d}_droplets.h5"
        told: dict[str, str | int | float] = {"run": "spray", "shot": seen, "exposures": json.dumps(exposures)}
        write_droplets(path, {"a": Droplets.none(), "b": droplets(seen, 2)}, told)
        rows = rows_of(export_droplets(path, "csv"))
        without = [row for row in rows if not row["x_mm"]]
        assert rows[seen:] == without
        expected = [("a", "refused", "no light"), *([] if seen else [("b", "good", "")])]
        assert [(row["frame"], row["verdict"], row["doubts"]) for row in without] == expected
        assert {row["shot"] for row in rows} == {str(seen)}
    assert [(row["shot"], row["verdict"]) for row in rows_of(export_droplets(empty, "csv"))] == [("8", "not told")]


def test_csv_of_no_track_tells_its_verdict(tmp_path: Path) -> None:
    path = tmp_path / "none.h5"
    columns: dict[str, Any] = {name: np.empty(0) for name in ("track", "shot", "x_mm", "y_mm", "z_mm")}
    write_tracks(path, DropletTracks(columns, 0, 9, 2000.0, None), {"run": "spray"})
    assert [(row["x_mm"], row["verdict"]) for row in rows_of(export_tracks(path, "csv"))] == [("", "good")]


def test_parquet_keeps_columns_types_and_provenance(file: Path) -> None:
    table = parquet.read_table(export_droplets(file, "parquet"))
    stored = read_droplets(file)
    assert table.column_names == ["shot", *stored.columns, "verdict", "doubts"]
    assert table["verdict"].to_pylist() == ["good"] * 5 + ["doubtful"] * 3
    assert (table.schema.metadata[b"verdict"], table.schema.metadata[b"doubts"]) == (b"doubtful", DOUBT.encode())
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
    reader = vtkHDFReader()
    reader.SetFileName(str(export_droplets(file, "vtk")))
    reader.Update()
    points, stored = reader.GetOutput(), read_droplets(file).columns
    assert (points.GetNumberOfPoints(), points.GetNumberOfVerts(), points.GetNumberOfCells()) == (8, 8, 8)
    xyz = vtk_to_numpy(points.GetPoints().GetData())
    np.testing.assert_array_equal(xyz, np.column_stack([stored[f"{axis}_mm"] for axis in "xyz"]))
    arrays = points.GetPointData()
    for name in ("amplitude", "residual", "cov_xz_mm2"):
        np.testing.assert_array_equal(vtk_to_numpy(arrays.GetArray(name)), stored[name])
    assert vtk_to_numpy(arrays.GetArray("exposure")).tolist() == [0] * 5 + [1] * 3
    assert vtk_to_numpy(arrays.GetArray("doubtful")).tolist() == [0] * 5 + [1] * 3


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
    assert export_droplets(empty, "csv").read_text().startswith("shot,frame,x_mm")
    schema = parquet.read_table(export_droplets(empty, "parquet")).schema
    assert [str(schema.field(name).type) for name in ("frame", "x_mm")] == ["string", "double"]


def test_an_export_that_cannot_be_written_leaves_the_old_one(file: Path) -> None:
    export_droplets(file, "vtk").write_text("old")
    stored = read_droplets(file)
    flat = {name: column for name, column in stored.columns.items() if name != "z_mm"}
    write_columns(file, {**flat, "frame": flat["frame"].astype("S1")}, stored.provenance)
    with pytest.raises(DropletFileError, match="droplets without z_mm have no place in space; export csv"):
        export_droplets(file, "vtk")
    assert file.with_suffix(".vtkhdf").read_text() == "old"


@pytest.mark.parametrize("edited", ["u_m_s", "doubts"])
def test_tracks_that_were_edited_are_refused(tracks: Path, tmp_path: Path, edited: str) -> None:
    shutil.copy(tracks, file := tmp_path / "edited.h5")
    with h5py.File(file, "r+") as opened:
        if edited == "doubts":
            opened["tomoshadow"].attrs["doubts"] = '["none"]'
        else:
            opened["tracks/u_m_s"][:] *= 1.5
    with pytest.raises(DropletFileError, match="was changed after its droplets had been linked"):
        read_tracks(file)


def test_tracks_are_read_as_they_were_written(tracks: Path, file: Path) -> None:
    stored = read_tracks(tracks)
    assert stored.columns["shot"].tolist() == [3, 4, 6, 3, 4, 5, 6]
    assert stored.provenance == {"run": 'a "spray"', "rate_hz": 2000.0, "half_window": 2, "doubts": "[]"}
    with pytest.raises(DropletFileError, match="not a readable file of tracks"):
        read_tracks(file)


def test_tracks_are_a_row_per_droplet_in_csv_and_parquet(tracks: Path) -> None:
    stored = read_tracks(tracks).columns
    with export_tracks(tracks, "csv").open(newline="") as text:
        rows = list(csv.DictReader(text))
    assert list(rows[0]) == [*stored, "verdict", "doubts"]
    assert [float(row["u_m_s"]) for row in rows] == stored["u_m_s"].tolist()
    assert [row["p_link"] == "" for row in rows] == np.isnan(stored["p_link"]).tolist()
    table = parquet.read_table(export_tracks(tracks, "parquet"))
    assert table["track"].to_pylist() == stored["track"].tolist()
    assert json.loads(table.schema.metadata[b"tomoshadow"])["rate_hz"] == 2000.0


def test_tracks_are_lines_in_vtkhdf(tracks: Path) -> None:
    stored = read_tracks(tracks).columns
    with h5py.File(export_tracks(tracks, "vtk")) as written:
        poly = written["VTKHDF"]
        np.testing.assert_array_equal(poly["Points"], np.column_stack([stored[f"{axis}_mm"] for axis in "xyz"]))
        lines = poly["Lines"]
        assert (lines["NumberOfCells"][:].tolist(), lines["NumberOfConnectivityIds"][:].tolist()) == ([2], [7])
        assert lines["Offsets"][:].tolist() == [0, 3, 7]
        assert lines["Connectivity"][:].tolist() == list(range(7))
        assert poly["Vertices"]["NumberOfCells"][:].tolist() == [0]
        np.testing.assert_array_equal(poly["PointData/u_m_s"], stored["u_m_s"])


def test_tecplot_has_a_zone_per_exposure_and_no_number_that_is_none(file: Path) -> None:
    path, stored = export_droplets(file, "tecplot"), read_droplets(file).columns
    assert path.name == "shot_00007_droplets.dat"
    title, names, zones, told = tecplot_zones(path)
    assert title == "spray, shot 7"
    assert told == {"verdict": "doubtful", "doubts": DOUBT.replace('"', "'")}
    assert names[:3] == ["x_mm", "y_mm", "z_mm"]
    assert set(names) == {"shot", "doubtful", *stored} - {"frame"}
    assert [(zone.title, zone.time, len(zone.rows)) for zone in zones] == [
        ("exposure a, without p_real", 7, 5), ("exposure b, without p_real", 7, 3)
    ]  # fmt: skip
    assert [zone.told["verdict"] for zone in zones] == ["good", "doubtful"]
    assert zones[0].strand != zones[1].strand
    read = np.vstack([zone.rows for zone in zones])
    ours = {**stored, "shot": np.full(8, 7), "doubtful": np.repeat([0, 1], [5, 3]), "p_real": np.full(8, -999.0)}
    for number, name in enumerate(names):
        np.testing.assert_array_equal(read[:, number], ours[name])


def test_a_reader_of_others_has_all_zones_of_tecplot(file: Path, tracks: Path) -> None:
    """That of VTK, by which ParaView opens them: its numbers have single precision."""
    vtkObject.GlobalWarningDisplayOff()
    for path in (export_droplets(file, "tecplot"), export_tracks(tracks, "tecplot")):
        reader = vtkTecplotReader()
        reader.SetFileName(str(path))
        reader.Update()
        _, names, zones, _ = tecplot_zones(path)
        blocks = [reader.GetOutput().GetBlock(number) for number in range(reader.GetOutput().GetNumberOfBlocks())]
        assert [block.GetNumberOfPoints() for block in blocks] == [len(zone.rows) for zone in zones]
        for block, zone in zip(blocks, zones, strict=True):
            seen = [vtk_to_numpy(block.GetPoints().GetData())]
            seen += [vtk_to_numpy(block.GetPointData().GetArray(name))[:, None] for name in names[3:]]
            np.testing.assert_array_equal(np.hstack(seen), zone.rows.astype(np.float32))


def test_tecplot_has_a_zone_per_shot_of_tracks_and_its_time(tracks: Path) -> None:
    title, names, zones, told = tecplot_zones(export_tracks(tracks, "tecplot"))
    stored = read_tracks(tracks).columns
    assert (title, told) == ("a 'spray'", {"verdict": "good"})
    assert [(zone.title, zone.time) for zone in zones] == [
        ("shot 3, without p_link", 0.0015), ("shot 4", 0.002), ("shot 5", 0.0025), ("shot 6", 0.003)
    ]  # fmt: skip
    assert len({(zone.strand, zone.time) for zone in zones}) == len(zones)
    read = np.vstack([zone.rows for zone in zones])
    order = np.lexsort([stored["track"], stored["shot"]])
    ours = {**stored, "doubtful": np.zeros(7)}
    for number, name in enumerate(names):
        np.testing.assert_array_equal(read[:, number], np.nan_to_num(ours[name], nan=-999.0)[order])


def test_velocities_that_are_less_good_than_places_are_told_beside_them(tmp_path: Path) -> None:
    path, velocity = tmp_path / "shot_00001_droplets.h5", {"verdict": "refused", "reasons": ["rows are even"]}
    told = {"exposures": json.dumps({"a": EXPOSURES["a"]}), "velocity": json.dumps(velocity)}
    write_droplets(path, {"a": droplets(2, 1)}, told, velocities={"a": {"u_m_s": np.full(2, np.nan)}})
    with export_droplets(path, "csv").open(newline="") as text:
        rows = list(csv.DictReader(text))
    assert {(row["verdict"], row["velocity_verdict"], row["doubts"]) for row in rows} == {
        ("good", "refused", "velocities: rows are even")
    }
    _, names, (zone,), _ = tecplot_zones(export_droplets(path, "tecplot"))
    assert zone.rows[:, names.index("doubtful")].tolist() == [1, 1]


def test_a_file_that_does_not_say_what_became_of_it_is_not_called_good(tmp_path: Path) -> None:
    path = tmp_path / "old.h5"
    write_droplets(path, {"a": droplets(2, 1)}, {"run": "spray"})
    with export_droplets(path, "csv").open(newline="") as text:
        assert {row["verdict"] for row in csv.DictReader(text)} == {"not told"}


def test_a_shot_without_droplets_has_no_zones(empty: Path) -> None:
    _, names, zones, told = tecplot_zones(export_droplets(empty, "tecplot"))
    assert (names[0], zones, told["verdict"]) == ("x_mm", [], "not told")
