"""Slices and regions of volumes that are not stored: made from the images, bit by bit as the whole volume has them."""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from numpy.typing import NDArray

from processing.reconstruction.choices import ReconstructionMethod, VoxelType
from processing.reconstruction.settings import GridSettings, ReconstructionSettings
from processing.reconstruction.volume_file import read_volume
from processing.runs.volumes.pipeline import reconstruct_shot
from processing.runs.volumes.volume_parts import VolumeParts
from processing.volume import VoxelGrid
from server.lab.calibrations import CalibrationStore
from server.lab.errors import Conflict, Damaged, NotFound
from server.lab.results import keep_preview, part_of, remaking
from server.lab.tasks import reconstruct
from server.pictures.pictures import Colours, plane_png
from server.pictures.previews import preview_path
from tests.support.droplet_run import write_calibration, write_run
from tests.support.serving import Serving

GRID = VoxelGrid.centred((41, 61, 71), 0.05)
SETTINGS = ReconstructionSettings(grid=GridSettings.of(GRID), minimum_window_px=0)
SIGHT = [method for method in ReconstructionMethod if not method.iterative]
ALL = dict.fromkeys("xyz")


@dataclass(frozen=True)
class Kept:
    """A run with the preview of one exposure by each kind of settings."""

    run_dir: Path
    store: CalibrationStore

    def made(self, settings: ReconstructionSettings) -> Path:
        out = self.run_dir / "results" / settings.results_id("c")
        reconstruct_shot(self.run_dir, 0, self.store.path("c"), settings, out, keep=keep_preview)
        return out / "shot_00000_b.vtkhdf"

    def whole(self, settings: ReconstructionSettings, folder: Path) -> NDArray[np.float32]:
        reconstruct_shot(self.run_dir, 0, self.store.path("c"), settings, folder)
        return read_volume(folder / "shot_00000_b.vtkhdf")[0]


@pytest.fixture
def kept(tmp_path: Path) -> Kept:
    return kept_in(tmp_path)


def kept_in(data_dir: Path) -> Kept:
    store = CalibrationStore(data_dir / "calibrations")
    write_calibration(store.path("c"))
    return Kept(write_run(data_dir / "run"), store)


@pytest.mark.parametrize("voxels", VoxelType)
@pytest.mark.parametrize("method", SIGHT)
def test_a_part_is_that_of_the_volume_that_a_command_writes(
    kept: Kept, tmp_path: Path, method: ReconstructionMethod, voxels: VoxelType
) -> None:
    settings = SETTINGS.model_copy(update={"method": method, "voxels": voxels})
    expected = kept.whole(settings, tmp_path / "whole")
    volume, parts = kept.made(settings), VolumeParts()
    assert expected.any()
    np.testing.assert_array_equal(part_of(parts, volume, kept.store, ALL).voxels, expected)
    across_z = part_of(parts, volume, kept.store, {"z": (0.31, 0.31)})
    np.testing.assert_array_equal(across_z.voxels[0], expected[26])
    assert across_z.grid.origin_mm == pytest.approx((*GRID.origin_mm[:2], 0.3))
    region = part_of(parts, volume, kept.store, {"x": (-0.5, 0.25), "y": (0.9, 9.0), "z": (-1.0, -1.0)})
    np.testing.assert_array_equal(region.voxels, expected[:1, 48:, 25:41])


def test_another_method_makes_what_its_own_volume_has(kept: Kept, tmp_path: Path) -> None:
    volume, parts = kept.made(SETTINGS), VolumeParts()
    other = SETTINGS.model_copy(update={"method": ReconstructionMethod.GAVLOS})
    looked_at = part_of(parts, volume, kept.store, ALL, ReconstructionMethod.GAVLOS)
    np.testing.assert_array_equal(looked_at.voxels, kept.whole(other, tmp_path / "whole"))
    assert looked_at.method is ReconstructionMethod.GAVLOS


def test_an_iterative_volume_has_parts_once_all_of_it_is_stored(kept: Kept) -> None:
    settings = SETTINGS.model_copy(update={"method": ReconstructionMethod.SMART, "iterations": 2})
    volume, parts = kept.made(settings), VolumeParts()
    with pytest.raises(Conflict, match=r"smart computes the whole volume.*download volume.vtkhdf.*method=mlos"):
        part_of(parts, volume, kept.store, {"z": (0.0, 0.0)})
    assert part_of(parts, volume, kept.store, {"z": (0.0, 0.0)}, ReconstructionMethod.MLOS).voxels.any()
    reconstruct({**remaking(volume), "calibration_file": str(kept.store.path("c"))}, lambda: False)
    expected = read_volume(volume)[0]
    assert expected.any()
    np.testing.assert_array_equal(part_of(parts, volume, kept.store, ALL).voxels, expected)
    np.testing.assert_array_equal(part_of(parts, volume, kept.store, {"x": (0.1, 0.1)}).voxels, expected[..., 37:38])
    with pytest.raises(Conflict, match="mart computes the whole volume"):
        part_of(parts, volume, kept.store, ALL, ReconstructionMethod.MART)


def test_what_is_looked_at_again_is_not_read_again(kept: Kept) -> None:
    volume, parts = kept.made(SETTINGS), VolumeParts()
    part_of(parts, volume, kept.store, {"z": (0.0, 0.0)})
    shutil.rmtree(kept.run_dir / "shots")
    assert part_of(parts, volume, kept.store, ALL, ReconstructionMethod.MINLOS).voxels.any()


@pytest.mark.parametrize("name", ["shot_00001_b", "shot_00000_a"])
def test_a_preview_that_was_renamed_stands_for_no_other_volume(kept: Kept, name: str) -> None:
    volume = kept.made(SETTINGS)
    renamed = volume.with_name(f"{name}.vtkhdf")
    shutil.copy(preview_path(volume), preview_path(renamed))
    with pytest.raises(Damaged, match=f"{name}.vtkhdf.*is of shot 0, exposure b"):
        part_of(VolumeParts(), renamed, kept.store, ALL)


def test_a_part_of_another_volume_than_was_kept_is_refused(kept: Kept) -> None:
    volume, parts = kept.made(SETTINGS), VolumeParts()
    document = json.loads(kept.store.path("c").read_text())
    kept.store.path("c").write_text(json.dumps(document, indent=1))
    with pytest.raises(Conflict, match=r"run, shot 0: was made with calibration_sha256 .* reconstruct the shot anew"):
        part_of(parts, volume, kept.store, ALL)
    kept.store.path("c").unlink()
    with pytest.raises(Conflict, match=r"shot_00000_b.vtkhdf: .*c\.json"):
        part_of(parts, volume, kept.store, ALL)
    preview_path(volume).unlink()
    with pytest.raises(NotFound, match=r"shot_00000_b\.vtkhdf is not there any more"):
        part_of(parts, volume, kept.store, ALL)


@pytest.mark.parametrize("other", ["other", "run"], ids=["another name", "the same name"])
def test_what_was_made_of_a_run_is_not_shown_of_another_one_in_its_place(
    other: str, server: Serving, tmp_path: Path
) -> None:
    kept = kept_in(server.services.data_dir)
    volume = kept.made(SETTINGS)
    kept.whole(SETTINGS, volume.parent)
    at = f"/api/runs/run/results/{volume.parent.name}/{volume.stem}"
    asked = ["", "/slices/z/3.png", "/projections/x.png", "/surface.glb", "/region.f32?z_mm=0", "/volume.vtkhdf"]
    assert [server.http.get(at + what).status_code for what in asked] == 6 * [200]
    stranger = write_run(tmp_path / "elsewhere" / other, created_utc="2026-01-02T00:00:00+00:00")
    (stranger / "run.h5").replace(kept.run_dir / "run.h5")
    told = [server.http.get(at + what) for what in asked]
    assert [answer.status_code for answer in told] == 6 * [409]
    known_by = "lies in run other" if other == "other" else "began at 2026-01-02T00:00:00"
    assert all(known_by in answer.json()["detail"] for answer in told)
    volume.unlink()
    assert server.http.get(f"{at}/volume.vtkhdf").status_code == 409


@dataclass(frozen=True)
class Looking:
    """A server with a run and a preview in it."""

    http: httpx.Client
    url: str
    expected: NDArray[np.float32]

    def ask(self, what: str, **query: Any) -> httpx.Response:
        return self.http.get(f"{self.url}/{what}", params=query)


@pytest.fixture
def looking(server: Serving, tmp_path: Path) -> Looking:
    kept = kept_in(server.services.data_dir)
    volume = kept.made(SETTINGS)
    url = f"/api/runs/run/results/{volume.parent.name}/{volume.stem}"
    return Looking(server.http, url, kept.whole(SETTINGS, tmp_path / "whole"))


def test_a_region_comes_as_plain_numbers_and_says_where_it_lies(looking: Looking) -> None:
    answer = looking.ask("region.f32", x_mm="-0.5:0.25", y_mm="0.9:9", z_mm="-1.0")
    assert answer.status_code == 200, answer.text
    shape = tuple(map(int, answer.headers["tomoshadow-shape"].split(",")))
    voxels = np.frombuffer(answer.content, "<f4").reshape(shape)
    np.testing.assert_array_equal(voxels, looking.expected[:1, 48:, 25:41])
    origin_mm = list(map(float, answer.headers["tomoshadow-origin-mm"].split(",")))
    assert origin_mm == pytest.approx([-0.5, 0.9, -1.0])
    assert float(answer.headers["tomoshadow-pitch-mm"]) == GRID.pitch_mm
    assert answer.headers["tomoshadow-method"] == "mlos"


@pytest.mark.parametrize(("axis", "number"), [("x", 2), ("y", 1), ("z", 0)])
def test_a_slice_comes_as_a_picture_of_every_voxel(looking: Looking, axis: str, number: int) -> None:
    index = int(np.unravel_index(looking.expected.argmax(), GRID.shape)[number])
    at_mm = float(getattr(GRID, f"{axis}_mm")[index]) + 0.02
    answer = looking.ask("slice.png", axis=axis, at_mm=at_mm)
    assert answer.status_code == 200, answer.text
    plane = np.take(looking.expected, index, number)
    assert answer.content == plane_png(plane.T if axis == "x" else plane, float(looking.expected.max()))
    other = looking.ask("slice.png", axis=axis, at_mm=at_mm, method="minlos")
    assert other.headers["tomoshadow-method"] == "minlos"
    assert other.content != answer.content
    assert other.headers["content-disposition"] != answer.headers["content-disposition"]
    shown = looking.ask("slice.png", axis=axis, at_mm=at_mm, colours="red", limit=0.25)
    assert shown.content == plane_png(plane.T if axis == "x" else plane, 0.25, Colours.RED)


@pytest.mark.parametrize(("axis", "number"), [("x", 2), ("y", 1), ("z", 0)])
def test_a_region_is_seen_along_an_axis_by_another_method_too(looking: Looking, axis: str, number: int) -> None:
    where = {"x_mm": "-0.5:0.25", "y_mm": "0.3:0.9", "z_mm": "-1.0:0.5"}
    answer = looking.ask("region.png", axis=axis, colours="blue", limit=0.25, **where)
    assert answer.status_code == 200, answer.text
    region = looking.ask("region.f32", **where)
    shape = tuple(map(int, region.headers["tomoshadow-shape"].split(",")))
    plane = np.frombuffer(region.content, "<f4").reshape(shape).max(number)
    assert answer.content == plane_png(plane.T if axis == "x" else plane, 0.25, Colours.BLUE)
    other = looking.ask("region.png", axis=axis, method="minlos", **where)
    assert (other.status_code, other.headers["tomoshadow-method"]) == (200, "minlos")


@pytest.mark.parametrize(
    ("what", "query", "status", "told"),
    [
        (
            "slice.png",
            {"axis": "z", "at_mm": 1.1},
            422,
            "z from 1.1 to 1.1 mm: no voxel there, the volume has z from -1 to 1",
        ),
        ("slice.png", {"axis": "z", "at_mm": "nan"}, 422, "at_mm"),
        ("slice.png", {"axis": "z", "at_mm": 0, "method": "smart"}, 409, "smart computes the whole volume"),
        ("region.f32", {"x_mm": "0.5:-0.5"}, 422, "x from 0.5 to -0.5 mm: no voxel there"),
        ("region.f32", {"x_mm": "0.01:0.02"}, 422, "x from 0.01 to 0.02 mm: no voxel there"),
        ("region.f32", {"x_mm": "1:2:3"}, 422, "x_mm"),
        ("region.png", {"axis": "z", "z_mm": "5:6"}, 422, "z from 5 to 6 mm: no voxel there"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(
    looking: Looking, what: str, query: dict[str, Any], status: int, told: str
) -> None:
    answer = looking.ask(what, **query)
    assert answer.status_code == status, answer.text
    assert told in answer.json()["detail"]


def test_a_part_has_a_largest_size(looking: Looking, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("processing.reconstruction.volume_part.MOST_VOXELS", looking.expected.size - 1)
    answer = looking.ask("region.f32")
    assert answer.status_code == 422
    assert f"41 x 61 x 71 = {looking.expected.size} voxels, limit" in answer.json()["detail"]
    assert looking.ask("region.f32", z_mm="-0.95:1").status_code == 200


def test_a_lost_shot_is_named(looking: Looking, server: Serving) -> None:
    (server.services.data_dir / "run" / "shots" / "0.h5").unlink()
    answer = looking.ask("slice.png", axis="y", at_mm=0)
    assert (answer.status_code, answer.json()["type"]) == (500, "urn:tomoshadow:ShotFileError")
    assert "shots/0.h5: cannot be read: it is missing" in answer.json()["detail"]
