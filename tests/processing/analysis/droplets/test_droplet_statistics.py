"""What droplets of several shots say together."""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import DropletFileError, StoredDroplets, read_droplets, write_columns
from processing.analysis.droplets.droplet_statistics import droplet_statistics
from processing.analysis.droplets.ghost_share import told_share
from processing.analysis.droplets.size_statistics import mean_diameters, number_density, shots_density
from processing.reconstruction.settings import GridSettings

GRID = GridSettings(shape=(2, 4, 6), origin_mm=(0, 0, 0), pitch_mm=0.5)
VOLUME_MM3 = 6.0


def shot(sizes_um: list[float] | None, n: int = 0, **told: Any) -> StoredDroplets:
    """A shot of one exposure unless it is told otherwise."""
    diameters = {} if sizes_um is None else {"diameter_um": np.array(sizes_um)}
    rows = n if sizes_um is None else len(sizes_um)
    exposures = told.pop("exposures", {"a": exposure()})
    provenance = {"run": "spray", "shot": 3, "settings": '{"grid": null}', "grid": GRID.model_dump_json(), **told}
    return StoredDroplets(
        {"frame": np.full(rows, "a"), **diameters}, {**provenance, "exposures": json.dumps(exposures)}
    )


def exposure(verdict: str = "good") -> dict[str, Any]:
    return {"verdict": verdict}


def with_p_real(stored: StoredDroplets, *p_real: float) -> StoredDroplets:
    return StoredDroplets({**stored.columns, "p_real": np.array(p_real)}, stored.provenance)


def test_shots_are_pooled() -> None:
    doubtful = {"a": exposure("doubtful")}
    statistics = droplet_statistics([shot([20.0, 30.0]), shot([40.0], exposures=doubtful, shot=4)])
    sizes = mean_diameters([[20.0, 30.0], [40.0]])
    assert (statistics.n, statistics.shots, statistics.exposures) == (3, 2, 2)
    assert {name: getattr(statistics, name) for name in type(sizes).model_fields} == dict(sizes)
    assert statistics.number_density_per_mm3 == shots_density([2, 1], [VOLUME_MM3] * 2)


def test_intervals_hold_what_the_light_is_not_known_to() -> None:
    """All diameters of a shot share it, and those of all shots: as many as there are do not take it out."""
    sizes_um = np.linspace(40, 80, 50).tolist()
    unsure = {"a": {**exposure(), "views": {name: {"light_sd_um": 3.0} for name in ("left", "right")}}}
    sure, told = (
        droplet_statistics([shot(sizes_um, exposures=one, shot=number) for number in range(20)])
        for one in ({"a": exposure()}, unsure)
    )
    assert (sure.light_sd_um, told.light_sd_um) == (0, 3)
    assert sure.d32_um is not None
    assert told.d32_um is not None
    assert told.d10_um is not None
    assert told.d32_um.value == sure.d32_um.value
    assert told.d32_um.high - told.d32_um.value > 5.8 > 2 > sure.d32_um.high - sure.d32_um.value
    assert told.d10_um.low == pytest.approx(60 * np.exp(-1.96 * 3 / 60), rel=0.01)
    assert told.relative_span == sure.relative_span


def test_ghosts_are_those_of_all_droplets_whose_probability_is_told() -> None:
    first, other = shot([20.0, 30.0]), shot([40.0, 50.0], shot=4, exposures={"a": exposure("doubtful")})
    told = droplet_statistics([with_p_real(first, 0.8, 1.0), with_p_real(other, np.nan, np.nan)])
    assert told.ghost_share == told_share(np.array([0.8, 1.0]), True)
    assert told.ghost_reason is None
    untold = droplet_statistics([with_p_real(first, 0.8, np.nan), with_p_real(other, np.nan, np.nan)])
    assert (untold.ghost_share, "unknown of 3 of 4" in (untold.ghost_reason or "")) == (None, True)
    old = droplet_statistics([first, with_p_real(other, 1.0, 1.0)])
    assert (old.ghost_share, "files from before" in (old.ghost_reason or "")) == (None, True)


@pytest.mark.parametrize(("objects", "beside"), [(1, True), (0, False)])
def test_beside_ligaments_they_are_the_reason(objects: int, beside: bool) -> None:
    """And no list of all that may be one."""
    seen = {"a": exposure() | {"hidden": {"liquid_objects": objects, "volume_share": 0.0}}}
    told = droplet_statistics([with_p_real(shot([20.0, 30.0], exposures=seen), np.nan, np.nan)])
    assert ("beside more ligaments and the like than 1 % of the droplets" in str(told.ghost_reason)) == beside
    assert ("droplets like the others" in str(told.ghost_reason)) != beside


def test_exposures_of_one_shot_show_the_same_droplets_twice() -> None:
    both = {"a": exposure(), "b": exposure()}
    statistics = droplet_statistics([shot([20.0, 30.0, 20.0, 30.0], exposures=both)])
    assert statistics.exposures == 2
    assert statistics.number_density_per_mm3 == number_density(2, VOLUME_MM3)
    assert statistics.d32_um == mean_diameters([[20.0, 30.0, 20.0, 30.0]], exposures_per_shot=2).d32_um


def test_refused_exposures_have_no_volume_and_empty_ones_have() -> None:
    one_of_two = {"a": exposure(), "b": exposure("refused")}
    statistics = droplet_statistics(
        [shot([20.0, 30.0], exposures=one_of_two), shot([], exposures={"a": exposure("empty")}, shot=4)]
    )
    assert (statistics.exposures, statistics.number_density_per_mm3) == (2, shots_density([2, 0], [VOLUME_MM3] * 2))


def test_where_a_number_is_missing_a_reason_is_told() -> None:
    nothing = droplet_statistics([shot([], exposures={"a": exposure("refused")})])
    assert (nothing.n, nothing.number_density_per_mm3, nothing.d32_um) == (0, None, None)
    assert nothing.reason == nothing.number_density_reason == "no exposure could be measured"
    bright = droplet_statistics([shot(None, n=7)])
    assert (bright.n, bright.d32_um) == (7, None)
    assert "only shadows tell" in (bright.reason or "")
    assert bright.number_density_per_mm3 == number_density(7, VOLUME_MM3)
    assert droplet_statistics([]).exposures == 0


def test_files_from_before_the_grid_was_stated_have_it_in_their_settings_or_say_so() -> None:
    named = json.dumps({"grid": GRID.model_dump(mode="json")})
    assert droplet_statistics([shot([9.0], grid="null", settings=named)]).number_density_per_mm3
    default = droplet_statistics([shot([9.0], grid="null")])
    assert default.number_density_per_mm3 is None
    assert "does not say in which volume" in (default.number_density_reason or "")


def test_a_shot_that_is_there_twice_is_refused() -> None:
    others: list[dict[str, Any]] = [{}, {"calibration": "other"}, {"settings": '{"twins": 1}'}]
    for told in others:
        with pytest.raises(DropletFileError, match="run spray, shot 3: its droplets are there 2 times"):
            droplet_statistics([shot([20.0, 30.0]), shot([20.0, 30.0], **told)])
    assert droplet_statistics([shot([20.0]), shot([20.0], run="other"), shot([20.0], view="left")]).n == 3


def test_sizes_in_pixels_are_not_said_to_be_of_bright_particles() -> None:
    flat = StoredDroplets({**shot(None, n=2).columns, "diameter_px": np.ones(2)}, shot(None, n=2).provenance)
    assert "--um-per-px" in (droplet_statistics([flat]).reason or "")


def test_a_file_that_says_nothing_of_its_exposures_is_named() -> None:
    foreign = StoredDroplets({"frame": np.full(2, "a")}, {"run": "spray", "shot": 3})
    with pytest.raises(DropletFileError, match="spray, shot 3: its file does not say what became of its exposures"):
        droplet_statistics([foreign])


@pytest.mark.parametrize(
    "told", [{"settings": '{"polarity": "bright"}'}, {"method_version": 2}], ids=["settings", "version"]
)
def test_numbers_of_two_recipes_are_not_pooled(told: dict[str, Any]) -> None:
    with pytest.raises(DropletFileError, match=r"spray, shot 4: measured with .*: numbers of two recipes"):
        droplet_statistics([shot([20.0, 30.0]), shot([40.0], shot=4, **told)])
    elsewhere = shot([40.0], shot=4, settings='{"grid": {"pitch_mm": 1}, "twins": 2}')
    assert droplet_statistics([shot([20.0, 30.0]), elsewhere]).n == 3


@pytest.mark.parametrize("diameter_um", [np.nan, 0.0, -20.0])
def test_a_diameter_that_none_can_be_is_told_with_its_shot(diameter_um: float) -> None:
    with pytest.raises(DropletFileError, match="spray, shot 3: was changed: a diameter is not finite, or not above 0"):
        droplet_statistics([shot([20.0, diameter_um])])


def test_columns_of_different_lengths_are_no_table(tmp_path: Path) -> None:
    columns = {"frame": np.array([b"a", b"a"]), "diameter_um": np.array([20.0, 30.0])}
    write_columns(tmp_path / "a.h5", columns, {"run": "spray"})
    assert len(read_droplets(tmp_path / "a.h5").columns["diameter_um"]) == 2
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file["droplets/diameter_um"]
        file["droplets/diameter_um"] = np.array([20.0])
    with pytest.raises(DropletFileError, match=r"a\.h5: was changed: its columns have 1 to 2 rows"):
        read_droplets(tmp_path / "a.h5")


def test_a_table_that_was_cut_is_no_table(tmp_path: Path) -> None:
    """All columns alike, as by a tool that copies the first rows: fewer droplets, and a lower density."""
    columns = {"frame": np.array([b"a", b"a", b"b"]), "diameter_um": np.array([20.0, 30.0, 31.0])}
    write_columns(tmp_path / "a.h5", columns, {"run": "spray"})
    with h5py.File(tmp_path / "a.h5", "a") as file:
        for name, column in columns.items():
            del file["droplets"][name]
            file["droplets"][name] = column[:2]
    with pytest.raises(DropletFileError, match=r"a\.h5: was changed: it was written with 3 rows, and has 2"):
        read_droplets(tmp_path / "a.h5")
