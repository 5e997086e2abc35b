"""Which runs of a long list are shown: those that are what somebody asks for, and all of those."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from daq.files.packed_file import holds_its_shots
from daq.files.run_directory import RunReader, pack
from daq.run.events import RunStatus
from daq.run_notes import RunNotes
from daq.run_plan import RunKind
from server.lab.runs.run_filter import ListedOutcome, RunFilter
from server.lab.runs.run_store import RunStore
from server.lab.runs.run_summary import PACKED, RunSummary
from tests.server.lab.runs.test_run_store import write_run, writer_of

WORD = st.text("abcXYZ", min_size=1, max_size=4)
NOTES = st.builds(RunNotes, operator=WORD, fluid=WORD, remark=WORD, more=st.dictionaries(st.just("grade"), WORD))
RUNS = st.builds(
    lambda run_id, **more: RunSummary(
        run_id=run_id, name=run_id, created_utc="2026-03-01T12:00:00+00:00", cause="", views=("view1",),
        frames_per_shot=2, shots_planned=1, shots_recorded=1, shots_valid=1, calibration=None, **more
    ),
    run_id=WORD, kind=st.sampled_from([None, *RunKind]), outcome=st.sampled_from([*ListedOutcome]), notes=NOTES,
)  # fmt: skip
WANTED = st.builds(
    RunFilter,
    kind=st.sampled_from([None, *RunKind]),
    outcome=st.sampled_from([None, *ListedOutcome]),
    text=st.lists(WORD, max_size=2).map(" ".join),
)


@given(run=RUNS, wanted=WANTED)
def test_more_that_is_asked_never_brings_more_runs(run: RunSummary, wanted: RunFilter) -> None:
    looser = [wanted.model_copy(update=change) for change in ({"kind": None}, {"outcome": None}, {"text": ""})]
    assert not wanted.accepts(run) or all(one.accepts(run) for one in looser)
    assert RunFilter().accepts(run)


@given(run=RUNS)
def test_a_run_is_found_by_what_it_is_and_by_any_piece_of_its_words_in_any_case(run: RunSummary) -> None:
    words = [run.run_id, run.notes.operator, run.notes.fluid, run.notes.remark, *map(str, run.notes.more.values())]
    text = " ".join(word[len(word) // 2 :].swapcase() for word in words)
    assert RunFilter(kind=run.kind, outcome=ListedOutcome(run.outcome), text=text).accepts(run)
    assert not RunFilter(text=f"{text} 7").accepts(run)


def test_pages_of_a_filter_are_the_filtered_list_and_its_count(tmp_path: Path) -> None:
    runs = [write_run(tmp_path / f"20260301T12000{second}-spray") for second in range(5)]
    for run_dir in runs[1::2]:
        (run_dir / "results" / "mlos-1").mkdir(parents=True)
        (run_dir / "results" / "mlos-1" / "settings.json").write_text("{}")
    store = RunStore(tmp_path, RunStatus)
    told = [[run.run_id for run in store.page(1, offset, RunFilter(results=True))[0]] for offset in range(3)]
    assert told == [[runs[3].name], [runs[1].name], []]
    assert store.page(1, 0, RunFilter(results=False))[1] == 3
    assert [run.run_id for run in store.with_results(9)] == [runs[3].name, runs[1].name]
    assert [run.run_id for run in store.with_results(1)] == [runs[3].name]
    assert store.page(9, 0, RunFilter(text="T120004"))[1] == 1
    assert store.page(9, 0, RunFilter(kind=RunKind.DARK)) == ([], 0)


def test_a_packed_run_is_told_as_such_with_what_to_do(tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "runs" / "20260301T120000-spray")
    assert not holds_its_shots(run_dir)
    pack(run_dir, tmp_path / "packed.h5")
    (tmp_path / "packed.h5").replace(run_dir / "run.h5")
    (run_dir / "shots").rename(tmp_path / "shots")
    (told,) = RunStore(run_dir.parent, RunStatus).newest()
    assert (told.outcome, told.name, told.shots_recorded, told.shots_valid) == (PACKED, "spray", 3, None)
    assert "completed" in told.cause
    assert "folder shots" in told.remedy
    (tmp_path / "shots").rename(run_dir / "shots")
    assert [run.outcome for run in RunStore(run_dir.parent, RunStatus).newest()] == ["completed"]


def test_a_damaged_run_says_what_to_do(tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "20260301T120000-spray")
    (run_dir / "run.h5").write_bytes(b"no HDF5")
    (told,) = RunStore(tmp_path, RunStatus).newest()
    assert f"tomoshadow repair {run_dir}" in told.remedy


def test_an_interrupted_run_tells_its_valid_shots(tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "20260301T120000-spray")
    for name in ("20260301T120001-open",):
        with writer_of(tmp_path / name):
            pass
    (open_run, closed) = RunStore(tmp_path, RunStatus).newest()
    assert (open_run.outcome, open_run.shots_valid, closed.shots_valid) == ("interrupted", 0, 2)
    assert RunReader(run_dir).outcome == "completed"
