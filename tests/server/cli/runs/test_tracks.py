"""``tomoshadow tracks``: droplets of a series become tracks in physical units; bad input gets one clear sentence."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import DropletFileError, read_droplets, write_columns, write_droplets
from processing.analysis.droplets.droplet_table import Droplets
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.analysis.velocity.track_file import read_tracks
from processing.analysis.velocity.track_table import track_droplets
from processing.reconstruction.settings import GridSettings
from processing.studies.velocity.track_truth import whole_and_right
from processing.volume import VoxelGrid
from tests.support.command_line import refused, shown, told
from tests.support.droplet_series import BOX, Series, series

RATE_HZ = 20_000.0
GRID = VoxelGrid((int(BOX[2]), int(BOX[1]), int(BOX[0])), (1.0, -2.0, 0.5), 1 / 60)


def write_series(folder: Path, shown: Series, missing: tuple[int, ...] = (), **more: Any) -> Path:
    """Files as measure writes them, the first shot being number 3."""
    folder.mkdir()
    for number, frame in enumerate(shown.frames):
        if number in missing:
            continue
        droplets = Droplets(
            points_mm=frame.places * GRID.pitch_mm + GRID.origin_mm,
            covariance_mm2=frame.covariance * GRID.pitch_mm**2,
            amplitudes=np.exp(frame.log_sizes),
            amplitude_sd=np.zeros(len(frame)),
            views=np.full(len(frame), 4),
            residual=np.ones(len(frame)),
            p_real=np.ones(len(frame)),
        )
        provenance = {"run": "spray", "shot": number + 3, "grid": GridSettings.of(GRID).model_dump_json(), **more}
        write_droplets(folder / f"shot_{number + 3:05d}_droplets.h5", {"a": droplets}, provenance)
    return folder


def test_rows_that_look_the_same_one_spacing_farther_on_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Droplets 30 voxels apart that fly by 34 from shot to shot are taken for such that fly by 4."""
    rng, shown = np.random.default_rng(5), series(frames=6)
    starts = np.array([(20, 0, 10), (50, 7, 40), (80, 16, 25)])
    frames = []
    for number in range(6):
        rows = (starts[:, None] + np.outer(np.arange(-7, 8), (0, 30, 0)) + (0, 34 * number, 0)).reshape(-1, 3)
        places = rows[(rows[:, 1] >= 0) & (rows[:, 1] < 180)] + rng.normal(0, 0.1, (1, 3))
        frames.append(MovingDroplets(places, np.tile(0.01 * np.eye(3), (len(places), 1, 1)), np.zeros(len(places))))
    results = write_series(tmp_path / "droplets", replace(shown, frames=frames), rate_hz=RATE_HZ)
    result = told(capsys, "tracks", results, "-o", tmp_path / "tracks.h5")
    assert result["tracks"] > 10
    assert "whether droplets fly 0.5 mm more or less" in "".join(one["what"] for one in result["not_checked"])


def test_tracks_of_a_series_lie_in_a_file_in_physical_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = series(frames=8)
    results = write_series(tmp_path / "droplets", shown, rate_hz=RATE_HZ)
    result = told(capsys, "tracks", results, "-o", tmp_path / "tracks.h5")
    with h5py.File(tmp_path / "tracks.h5") as file:
        columns = {name: column[:] for name, column in file["tracks"].items()}
        units = {name: column.attrs["units"] for name, column in file["tracks"].items()}
        attributes = dict(file["tomoshadow"].attrs)
    assert (attributes["schema"], attributes["rate_hz"], attributes["run"]) == ("tomoshadow/tracks", RATE_HZ, "spray")
    assert (units["u_m_s"], units["ax_m_s2"], units["cov_uv_m2_s2"]) == ("m/s", "m/s^2", "m^2/s^2")
    assert result["tracks"] == len(np.unique(columns["track"]))
    assert result["share_tracked"] > 0.9
    assert (result["half_window"], attributes["half_window"]) == (2, 2)
    (unchecked,) = result["not_checked"]
    assert f"whether there are {RATE_HZ:g} shots per second, as was stated" in unchecked["what"]
    ids = [np.full(len(frame), -1) for frame in shown.frames]
    for track, shot, row in zip(columns["track"], columns["shot"], columns["droplet"], strict=True):
        ids[shot - 3][row] = track
    whole, right = whole_and_right(ids, shown.labels)
    assert whole > 0.98
    assert right > 0.995
    rows = list(zip(columns["shot"] - 3, columns["droplet"], strict=True))
    labels = np.array([shown.labels[frame][row] for frame, row in rows])
    true = [shown.velocities[frame][label] for (frame, _), label in zip(rows, labels, strict=True)]
    known = np.isfinite(columns["u_m_s"]) & (labels >= 0)
    m_s = GRID.pitch_mm * 1e-3 * RATE_HZ
    error_m_s = columns["u_m_s"][known] - m_s * np.array(true)[known, 0]
    assert np.median(np.abs(error_m_s)) < 0.02 * m_s
    assert np.median(np.abs(error_m_s) / np.sqrt(columns["cov_uu_m2_s2"][known])) == pytest.approx(0.6745, rel=0.15)
    seen_mm = [shown.frames[frame].places[row][0] * GRID.pitch_mm + GRID.origin_mm[0] for frame, row in rows]
    assert np.median(np.abs(columns["x_mm"] - seen_mm)) < 0.035 * GRID.pitch_mm


def test_the_half_window_of_least_error_is_proposed_and_may_be_chosen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results = write_series(tmp_path / "droplets", series(frames=9, turn=0.0), rate_hz=RATE_HZ)
    command = ("tracks", results, "-o", tmp_path / "tracks.h5", "--overwrite")
    curve = told(capsys, *command)["noise_curve"]
    assert curve["half_windows"] == [1, 2, 3, 4]
    assert all(len(curve[name]) == 4 for name in curve if name.endswith(("_um", "_m_s", "_m_s2")))
    assert curve["velocity_noise_m_s"][0] == pytest.approx(0.035 / 2**0.5 * GRID.pitch_mm * 1e-3 * RATE_HZ, rel=0.01)
    assert curve["for_velocity"] >= 3
    said = f"half window of least error: {curve['for_velocity']} for velocities, {curve['for_acceleration']} for acc"
    assert said in shown(capsys, *command)
    assert "; 4 was taken" in shown(capsys, *command, "--half-window", 4)
    assert read_tracks(tmp_path / "tracks.h5").provenance["half_window"] == 4


def test_a_shot_that_is_not_there_is_a_frame_without_droplets(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results = write_series(tmp_path / "droplets", series(frames=8), missing=(4,))
    result = told(capsys, "tracks", results, "--rate-hz", "1000", "-o", tmp_path / "tracks.h5")
    assert (result["shots"], result["rate_hz"]) == (7, 1000)
    assert result["median_length"] >= 5


def test_shots_without_a_common_motion_have_no_tracks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mixed = Series([series(seed, frames=1).frames[0] for seed in range(4)], [], [], np.empty(0))
    results = write_series(tmp_path / "droplets", mixed, rate_hz=RATE_HZ)
    result = told(capsys, "tracks", results, "-o", tmp_path / "tracks.h5", status=1)
    assert (result["tracks"], result["passed"], result["median_length"]) == (0, False, None)
    assert "no droplet is on a track" in result["reason"]


def test_bad_input_gets_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = series(frames=2)
    unstated = write_series(tmp_path / "unstated", shown)
    out = tmp_path / "tracks.h5"
    assert "nobody stated at which rate" in refused(capsys, "tracks", unstated, "-o", out)
    assert "has no droplets of shots" in refused(capsys, "tracks", tmp_path, "-o", out)
    other = write_series(tmp_path / "other", shown, run="another", rate_hz=RATE_HZ, shot=7)
    (other / "shot_00003_droplets.h5").rename(unstated / "shot_00007_droplets.h5")
    assert "shots of one series, please: their run is" in refused(capsys, "tracks", unstated, "-o", out)
    copied = write_series(tmp_path / "copied", Series(shown.frames[:1] * 3, [], [], np.empty(0)), rate_hz=RATE_HZ)
    assert "spray, shot 4 has the very droplets of spray, shot 3" in refused(capsys, "tracks", copied, "-o", out)
    assert not out.exists()


@pytest.mark.parametrize("rate_hz", [0.0, -5.0, float("nan")])
def test_a_rate_that_none_can_be_is_refused(tmp_path: Path, rate_hz: float) -> None:
    results = write_series(tmp_path / "droplets", series(frames=2))
    shots = [read_droplets(file) for file in results.glob("*.h5")]
    with pytest.raises(DropletFileError, match="must be above 0"):
        track_droplets(shots, rate_hz)


def from_a_to_b(files: list[Path], step: np.ndarray, sd: float = 0.3) -> None:
    """Give droplets velocities of so many voxels per shot, less exact than those of tracks."""
    rng = np.random.default_rng(0)
    for file in files:
        stored = read_droplets(file)
        steps = step + rng.normal(0, sd, (len(stored.columns["frame"]), 3))
        flying = dict(zip(("u_m_s", "v_m_s", "w_m_s"), (steps * GRID.pitch_mm * RATE_HZ / 1000).T, strict=True))
        columns = {**stored.columns, **flying, "frame": stored.columns["frame"].astype("S1")}
        write_columns(file, columns, stored.provenance)


@pytest.mark.parametrize(
    ("tenths", "contradicted"),
    [([0, 10, 20, 30, 40, 50, 60], False), ([0, 10, 20, 31, 42, 54, 66], True), ([0, 9, 18, 28, 38, 49, 60], True)],
)
def test_shot_times_that_drift_contradict_velocities_from_a_to_b(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], tenths: list[int], contradicted: bool
) -> None:
    """Each interval is some percent longer: no jump shows it, and tracks are up to 20 % too fast, or too slow first."""
    results = write_series(tmp_path / "droplets", ordered(TENTHS, tenths), rate_hz=RATE_HZ)
    from_a_to_b(sorted(results.glob("*.h5")), np.array([1.2, 0.6, 0.2]), 0.1)
    doubts = told(capsys, "tracks", results, "-o", tmp_path / "tracks.h5")["doubts"]
    assert any("are shots at even times, and is the separation right?" in one for one in doubts) == contradicted, doubts


@pytest.mark.parametrize("seed", [3, 4])
def test_a_few_droplets_of_another_motion_are_not_checked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int
) -> None:
    """Fast ones leave the box before they are many; the mean speed of the tracks is 5 to 13 % too small."""
    slow = series(seed, 5.0, 8, step=(3.0, 0.0, 0.0), gradient=0.0)
    fast = series(seed + 50, 0.4, 8, step=(16.0, 0.0, 0.0), gradient=0.0)
    mixed = [joined(*frames) for frames in zip(slow.frames, fast.frames, strict=True)]
    for name, frames in (("mixed", mixed), ("slow", slow.frames)):
        results = write_series(tmp_path / name, Series(frames, [], [], np.empty(0)), rate_hz=RATE_HZ)
        result = told(capsys, "tracks", results, "-o", tmp_path / f"{name}.h5")
        said = "\n".join([*result["doubts"], *(one["what"] for one in result["not_checked"])])
        assert ("on no track" in said) == (name == "mixed"), said


def joined(*frames: MovingDroplets) -> MovingDroplets:
    parts = zip(*((one.places, one.covariance, one.log_sizes) for one in frames), strict=True)
    return MovingDroplets(*(np.concatenate(part) for part in parts))


def test_what_contradicts_the_rate_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown_series = series(frames=4)
    results = write_series(tmp_path / "droplets", shown_series, rate_hz=RATE_HZ)
    files = sorted(results.glob("*.h5"))
    from_a_to_b(files, np.array([4.0, 3.0, 1.5]))
    out = tmp_path / "tracks.h5"
    assert told(capsys, "tracks", results, "-o", out)["doubts"] == []
    (doubt,) = told(capsys, "tracks", results, "--rate-hz", RATE_HZ / 10, "-o", out, "--overwrite")["doubts"]
    assert "m/s from A to B: is the rate of 2000 Hz right, are shots at even times" in doubt
    assert doubt in shown(capsys, "tracks", results, "--rate-hz", RATE_HZ / 10, "-o", out, "--overwrite")
    fast, _ = told(capsys, "tracks", results, "--rate-hz", 1000 * RATE_HZ, "-o", out, "--overwrite")["doubts"]
    assert "faster than any spray: is the rate of 2e+07 Hz right?" in fast


def ordered(shown: Series, order: list[int]) -> Series:
    return Series([shown.frames[number] for number in order], [], [], np.empty(0))


TOGETHER = "all droplets together are suddenly faster or slower"


@pytest.mark.parametrize(
    ("order", "said"),
    [
        ([0, 1, 2, 3, 4, 5], []),
        ([0, 2, 1, 3, 5, 4], ["hardly a droplet of 3 of 6 shots is on a track (shot 3, 4, 8)", TOGETHER]),
        ([0, 1, 2, 7, 8, 9], ["hardly a track goes on after 1 of 6 shots (shot 5)", TOGETHER]),
        ([5, 4, 3, 2, 1, 0], ["droplets fly against the axis of the spray"]),
    ],
)
def test_shots_out_of_order_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], order: list[int], said: list[str]
) -> None:
    """Names that sort otherwise than they were taken: tracks fly twice as fast, or backwards, and look fine."""
    spray = json.dumps({"nozzle_mm": [0, 0, 0], "axis": [1, 0, 0]})
    shown_series = ordered(series(frames=10, scatter=0.1, turn=0.0), order)
    results = write_series(tmp_path / "droplets", shown_series, rate_hz=RATE_HZ, spray=spray)
    doubts = told(capsys, "tracks", results, "-o", tmp_path / "tracks.h5")["doubts"]
    assert len(doubts) == len(said), doubts
    for doubt, what in zip(doubts, said, strict=True):
        assert doubt.startswith(what)


TENTHS = series(density_per_mm3=8, frames=77, step=(0.12, 0.06, 0.02), scatter=0.003, turn=0.0, gradient=0.0003)
"""Ten frames for each that a camera would take: shots at any times can be chosen."""


@pytest.mark.parametrize(
    ("tenths", "told_of"),
    [
        ([0, 10, 20, 30, 40, 50, 60], None),
        ([0, 10, 21, 33, 46, 60, 75], None),  # faster and faster, as what falls
        ([0, 10, 20, 40, 50, 60, 70], "2 of 7 shots (shot 5, 6)"),
        ([0, 10, 20, 30, 50, 70], "1 of 6 shots (shot 6)"),
        ([0, 10, 22, 30, 39, 51, 60], "3 of 7 shots (shot 5, 7, 8)"),
    ],
)
def test_shots_at_uneven_times_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], tenths: list[int], told_of: str | None
) -> None:
    """Slow droplets stay on their tracks where a shot is missing, and seem to be faster there."""
    results = write_series(tmp_path / "droplets", ordered(TENTHS, tenths), rate_hz=RATE_HZ)
    doubts = told(capsys, "tracks", results, "-o", tmp_path / "tracks.h5")["doubts"]
    uneven = [doubt for doubt in doubts if doubt.startswith(TOGETHER)]
    assert len(uneven) == (told_of is not None), doubts
    assert told_of is None or told_of in uneven[0]


def test_a_rig_that_shakes_a_little_does_not_make_slow_droplets_fast(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shaken_voxel = np.random.default_rng(1).normal(0, 0.025, 20)
    slow = series(density_per_mm3=8, frames=20, step=(0.3, 0.1, 0.1), scatter=0.003, turn=0.0, gradient=0.0003)
    frames = [replace(one, places=one.places + by) for one, by in zip(slow.frames, shaken_voxel[:, None], strict=True)]
    results = write_series(tmp_path / "droplets", replace(slow, frames=frames), rate_hz=RATE_HZ)
    assert told(capsys, "tracks", results, "-o", tmp_path / "tracks.h5")["doubts"] == []


def test_shots_that_are_not_good_are_told_with_their_tracks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = {"a": {"verdict": "doubtful", "reasons": ["it is blurred"]}, "b": {"verdict": "refused", "reasons": []}}
    results = write_series(tmp_path / "droplets", series(frames=4), rate_hz=RATE_HZ, exposures=json.dumps(said))
    result = told(capsys, "tracks", results, "-o", tmp_path / "tracks.h5")
    assert result["doubts"] == ["4 of 4 exposures are doubtful, and count: it is blurred"]
    with h5py.File(tmp_path / "tracks.h5") as file:
        assert json.loads(file["tomoshadow"].attrs["doubts"]) == result["doubts"]


def test_tracks_are_exported_beside_their_file_and_not_over_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results = write_series(tmp_path / "droplets", series(frames=4), rate_hz=RATE_HZ)
    command = ("tracks", results, "-o", tmp_path / "tracks.h5", "--export", "csv,vtk,tecplot")
    result = told(capsys, *command)
    assert result["tracks"] > 0
    written = [tmp_path / f"tracks.{ending}" for ending in ("csv", "vtkhdf", "dat")]
    assert all(file.is_file() for file in written)
    (tmp_path / "tracks.h5").unlink()
    assert "tracks.csv" in refused(capsys, *command)


@pytest.mark.parametrize(
    ("droplets", "frames", "reason"),
    [
        (0, 4, "no droplet was measured in any shot"),
        (50, 2, "a track takes 3 shots with droplets, and there are 2"),
        (2, 5, "shots have 2 droplets at most: 3 tell which way they fly"),
    ],
)
def test_where_there_are_too_few_droplets_it_says_so(tmp_path: Path, droplets: int, frames: int, reason: str) -> None:
    shown = series(frames=5)
    few = replace(shown, frames=[frame.where(np.arange(droplets)) for frame in shown.frames[:frames]])
    results = write_series(tmp_path / "droplets", few, rate_hz=RATE_HZ)
    told = track_droplets([read_droplets(file) for file in sorted(results.glob("*_droplets.h5"))])
    assert reason in (told.reason or "")


def test_what_stands_still_is_doubtful(tmp_path: Path) -> None:
    """A little noise, as shots that are all the same are taken for copies."""
    first, rng = series(frames=5).frames[0], np.random.default_rng(1)
    noises = [rng.multivariate_normal(np.zeros(3), first.covariance[0], len(first)) for _ in range(5)]
    still = replace(series(frames=5), frames=[replace(first, places=first.places + noise) for noise in noises])
    results = write_series(tmp_path / "droplets", still, rate_hz=RATE_HZ)
    told = track_droplets([read_droplets(file) for file in sorted(results.glob("*_droplets.h5"))])
    assert told.tracks > 0
    assert any("stand still" in doubt and "is it dirt?" in doubt for doubt in told.doubts)
