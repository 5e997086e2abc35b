"""What the pages of runs and results compute for themselves: ticks, stripes, labels, and what is shown first."""

import json
import math
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from daq.run_plan import RunKind
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.settings import ReconstructionSettings
from processing.volume import VoxelGrid
from server.lab.jobs.job import JobState, reconstruction_job
from server.lab.jobs.job_table import JobTable
from server.lab.results import DropletsSummary, ResultSet, VolumeSummary
from server.lab.runs.run_summary import ACTIVE, DAMAGED, RunSummary
from server.web.ui.results.droplet_table import droplet_rows
from server.web.ui.results.looked_at import (
    exposures_of,
    first_of,
    label_of,
    method_of,
    nothing_text,
    set_with_droplets,
    shots_of,
)
from server.web.ui.results.seen_exposure import FullSlices
from server.web.ui.results.slice_view import SHOWN_AXES, spans_of
from server.web.ui.results.ticks import ticks_of
from server.web.ui.results.volume_view import state_text
from server.web.ui.runs.run_facts import facts_of
from server.web.ui.runs.run_work import progress_text
from server.web.ui.runs.shot_strip import next_invalid, strip_style, stripes

PLACES = st.floats(-1e4, 1e4)


def a_run(kind: RunKind | None, outcome: str, cause: str = "") -> RunSummary:
    return RunSummary(
        run_id="one",
        name="one",
        kind=kind,
        created_utc="2026-11-29T03:20:14Z",
        outcome=outcome,
        cause=cause,
        views=("view1",),
        frames_per_shot=2,
        shots_planned=6,
        shots_recorded=6,
        shots_valid=6,
        calibration=None,
    )


def test_only_of_what_can_be_reconstructed_it_is_said_to_do_so() -> None:
    assert "reconstruct or measure it below" in nothing_text(a_run(RunKind.SAMPLE, "completed"))
    assert "reconstruct or measure it below" in nothing_text(a_run(None, "completed"))
    assert nothing_text(a_run(RunKind.DARK, "completed")) == (
        "Run one is a dark run: volumes and droplets are made of sample runs."
    )
    assert (
        nothing_text(a_run(RunKind.SAMPLE, ACTIVE)) == "Run one is being recorded, and nothing has been made of it yet."
    )
    assert (
        nothing_text(a_run(None, DAMAGED, "run.h5 is torn"))
        == "Run one cannot be read: run.h5 is torn. Open the run for what to do."
    )


def test_droplets_are_numbers_that_can_be_sorted_and_an_unknown_one_is_none() -> None:
    columns = {"frame": np.array([b"a", b"b", b"a"]), "p_real": np.array([0.5, np.nan, 1.0])}
    columns |= {f"{axis}_mm": np.array([-5.58342, 1.5, 12.0]) for axis in "xyz"}
    rows = droplet_rows(StoredDroplets({**columns, "diameter_um": np.array([99.14, 1234.5, np.nan])}, {}, {}))
    assert [(row["id"], row["diameter_um"], row["p_real"]) for row in rows] == [
        (1, 1234.5, None),
        (0, 99.14, 0.5),
        (2, None, 1.0),
    ]
    assert rows[1]["x_mm"] == -5.58342


@given(low=PLACES, extent=st.floats(1e-3, 1e4), most=st.integers(2, 12))
def test_ticks_are_even_round_and_within_the_axis(low: float, extent: float, most: int) -> None:
    ticks = ticks_of(low, low + extent, most)
    assert 1 <= len(ticks) <= most
    assert all(low - 1e-6 <= tick <= low + extent + 1e-6 for tick in ticks)
    if len(ticks) > 1:
        step = np.diff(ticks)
        np.testing.assert_allclose(step, step[0], rtol=1e-4, atol=1e-8)
        mantissa = step[0] / 10 ** math.floor(math.log10(step[0]) + 1e-6)
        assert min(abs(mantissa - one) for one in (1, 2, 5, 10)) < 1e-3


@given(valid=st.lists(st.booleans(), max_size=50), most=st.integers(1, 60))
def test_no_invalid_shot_is_hidden_in_the_strip(valid: list[bool], most: int) -> None:
    told = stripes(valid, most)
    assert [first for first, _, _ in told[1:]] == [last for _, last, _ in told[:-1]]
    assert (told[0][0], told[-1][1]) == (0, 1) if valid else told == []
    for index, is_good in enumerate(valid):
        (stripe,) = [good for first, last, good in told if first <= (index + 0.5) / len(valid) < last]
        assert is_good or not stripe
    assert len(told) <= most
    assert strip_style(valid).startswith("background: ")


@given(valid=st.lists(st.booleans(), max_size=20), after=st.integers(-1, 20))
def test_every_invalid_shot_is_come_to(valid: list[bool], after: int) -> None:
    found, bad = [], [index for index, is_good in enumerate(valid) if not is_good]
    for _ in bad:
        index = next_invalid(valid, after)
        assert index is not None
        found.append(index)
        after = index
    assert sorted(found) == bad
    assert bad or next_invalid(valid, after) is None


@given(
    shape=st.tuples(st.integers(1, 9), st.integers(1, 9), st.integers(1, 9)),
    origin=st.tuples(PLACES, PLACES, PLACES),
    axis=st.sampled_from("xyz"),
)
def test_a_picture_covers_its_voxels_from_edge_to_edge(
    shape: tuple[int, int, int], origin: tuple[float, float, float], axis: str
) -> None:
    grid = VoxelGrid(shape, origin, 0.25)
    for span, name in zip(spans_of(grid, axis), SHOWN_AXES[axis], strict=True):
        assert span[1] - span[0] == np.float64(0.25 * len(getattr(grid, f"{name}_mm"))) or math.isclose(
            span[1] - span[0], 0.25 * len(getattr(grid, f"{name}_mm")), rel_tol=1e-6
        )
        assert axis not in SHOWN_AXES[axis]


def made(name: str, shots: tuple[int, ...], droplets: tuple[int, ...] = (), **provenance: object) -> ResultSet:
    volumes = [
        VolumeSummary(name=f"shot_{shot:05d}_{frame}", shot=shot, frame=frame, size_bytes=0)
        for shot in shots
        for frame in "ab"
    ]
    measured = [DropletsSummary(name=f"shot_{shot:05d}_droplets", shot=shot, size_bytes=1) for shot in droplets]
    return ResultSet(id=name, provenance=dict(provenance), volumes=tuple(volumes), droplets=tuple(measured))


def test_a_result_set_says_by_which_method_it_was_made() -> None:
    settings = ReconstructionSettings(method=ReconstructionMethod.SMART).model_dump_json()
    smart = made("smart-1", (0, 3), calibration_file="paper.json", settings=settings)
    assert method_of(smart) is ReconstructionMethod.SMART
    assert label_of(smart) == "SMART nominal · 2 shots · paper · smart-1"
    assert method_of(made("minlos-2", (0,))) is ReconstructionMethod.MINLOS
    droplets = made("droplets-3", (), (1,))
    assert method_of(droplets) is None
    assert label_of(droplets) == "droplets · 1 shot · droplets-3"
    for torn in ("{", "[]", json.dumps("text")):
        assert method_of(made("mlos-4", (0,), settings=torn)) is ReconstructionMethod.MLOS


def test_volumes_are_shown_before_droplets_and_with_those_of_their_shot() -> None:
    measured, volumes = made("droplets-3", (), (1, 2)), made("mlos-1", (0, 1))
    assert first_of([measured, volumes]) is volumes
    assert first_of([measured]) is measured
    assert first_of([]) is None
    assert shots_of(volumes) == [0, 1]
    assert exposures_of(volumes, 1) == {"a": "shot_00001_a", "b": "shot_00001_b"}
    assert set_with_droplets([measured, volumes], volumes, 1) is measured
    assert set_with_droplets([measured, volumes], volumes, 0) is None


def test_the_page_says_what_its_slices_are() -> None:
    minlos, limits = ReconstructionMethod.MINLOS, {"a": 1.0}
    assert state_text(FullSlices(minlos, limits), ReconstructionMethod.MLOS) == "MINLOS, full resolution"
    assert state_text(FullSlices(None, limits), ReconstructionMethod.MLOS) == "MLOS, full resolution"
    assert state_text(FullSlices(None, limits, "why"), None) == "as made, preview only: why"


def test_progress_counts_the_jobs_of_one_run_by_result_set(tmp_path: Path) -> None:
    table = JobTable(tmp_path / "jobs.sqlite")
    for run_id, results_id, shot in (
        ("one", "mlos-1", 0),
        ("one", "mlos-1", 1),
        ("one", "smart-1", 0),
        ("two", "x", 0),
    ):
        table.add(reconstruction_job(run_id, shot, "cal", results_id, {}))
    for job_id, last in (("one.mlos-1.00000", JobState.DONE), ("one.mlos-1.00001", JobState.FAILED)):
        table.move(job_id, JobState.RUNNING)
        table.move(job_id, last)
    newer, older = table.progress("one")
    assert (newer.results_id, newer.waiting) == ("smart-1", 1)
    assert (older.shots, older.done, older.failed, older.waiting) == (2, 1, 1, 0)
    assert progress_text(older) == "mlos-1: 1 of 2 shots done, 1 failed or aborted"
    assert table.progress("none") == []
    table.close()


def test_facts_leave_out_what_says_nothing() -> None:
    document = {
        "name": "day",
        "pulse": {"width_ns": 0, "current_a": {"view1": 5}},
        "none": None,
        "empty": [],
        "z": [1, 2],
    }
    assert facts_of(document) == [
        ("name", "day"),
        ("pulse · width ns", "0"),
        ("pulse · current a · view1", "5"),
        ("z", "1, 2"),
    ]
