"""The recorder under real faults: killed, out of disk, overrun."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest

from daq.errors import RecorderError, RecorderOverflow
from daq.files.recovery import INTERRUPTED_CAUSE, recover
from daq.files.run_directory import (
    DoubleFrame,
    ExposureRecord,
    ImageKey,
    RunHeader,
    RunReader,
    RunWriter,
    Shot,
    ViewFormat,
)
from daq.files.shot_file import EncodedShot
from daq.run.recorder import Recorder

SHAPE = (120, 160)
HEADER = RunHeader(
    run_id="run", created_utc="2026-11-22T10:15:30Z", views={f"view{n}": ViewFormat(SHAPE, 12) for n in (1, 2)}
)
DEADLINE_S = 30.0


def shot_of(index: int) -> Shot:
    rng = np.random.default_rng(index)

    def double_frame() -> DoubleFrame:
        images = rng.integers(0, 4096, (2, *SHAPE), np.uint16)
        return DoubleFrame(images[0], images[1], ExposureRecord(True, 1), ExposureRecord(True, 2))

    return Shot(index, ImageKey.SAMPLE, {view: double_frame() for view in HEADER.views})


def assert_stored(run_dir: Path, index: int) -> None:
    read, written = RunReader(run_dir).read_shot(index), shot_of(index)
    for view, expected in written.views.items():
        np.testing.assert_array_equal(read.views[view].frame_a, expected.frame_a)
        np.testing.assert_array_equal(read.views[view].frame_b, expected.frame_b)


class GatedWriter(RunWriter):
    """A disk that does not move until it is told to."""

    def __init__(self, run_dir: Path, header: RunHeader) -> None:
        super().__init__(run_dir, header)
        self.gate = threading.Event()

    def commit(self, index: int) -> None:
        assert self.gate.wait(DEADLINE_S)
        super().commit(index)


class LateWriter(GatedWriter):
    """A disk that says only when it moves that it takes nothing."""

    def stage(self, index: int, encoded: EncodedShot) -> None:
        assert self.gate.wait(DEADLINE_S)
        raise RecorderError(f"shot {index} came to nothing")


def test_shots_are_committed_in_order_by_any_number_of_threads(tmp_path: Path) -> None:
    seen: list[int] = []
    with (
        RunWriter(tmp_path / "run", HEADER) as writer,
        Recorder(writer, depth=100, threads=4, on_commit=lambda shot: seen.append(shot.index)) as recorder,
    ):
        for index in range(40):
            recorder.put(shot_of(index))
        recorder.close(DEADLINE_S)
        assert recorder.committed == 40
    assert seen == list(range(40))
    for index in (0, 17, 39):
        assert_stored(tmp_path / "run", index)


def test_a_full_queue_is_an_error_at_once(tmp_path: Path) -> None:
    with GatedWriter(tmp_path / "run", HEADER) as writer, Recorder(writer, depth=3) as recorder:
        for index in range(3):
            recorder.put(shot_of(index))
        with pytest.raises(RecorderOverflow, match="shot 3: 3 shots wait already"):
            recorder.put(shot_of(3))
        writer.gate.set()
        recorder.close(DEADLINE_S)
    assert RunReader(tmp_path / "run").shot_count == 3


def test_a_disk_that_hangs_is_an_error_within_the_deadline(tmp_path: Path) -> None:
    with GatedWriter(tmp_path / "run", HEADER) as writer, Recorder(writer) as recorder:
        recorder.put(shot_of(0))
        with pytest.raises(RecorderError, match=r"1 of 1 shots are not stored after 0\.05 s"):
            recorder.close(0.05)
        writer.gate.set()


def test_a_failure_is_told_at_once_while_shots_are_taken_and_never_after(tmp_path: Path) -> None:
    told: list[RecorderError] = []
    heard = threading.Event()

    def listen(error: RecorderError) -> None:
        told.append(error)
        heard.set()

    with RunWriter(tmp_path / "run", HEADER) as writer, Recorder(writer, on_failure=listen) as recorder:
        (tmp_path / "run" / "shots" / "0.h5").write_bytes(b"in the way")
        recorder.put(shot_of(0))
        assert heard.wait(DEADLINE_S)
        assert "shot 0 cannot be stored" in str(told[0])
        with pytest.raises(RecorderError, match="shot 0 cannot be stored"):
            recorder.close(DEADLINE_S)
    told.clear()
    with LateWriter(tmp_path / "late", HEADER) as late, Recorder(late, on_failure=listen) as recorder:
        recorder.put(shot_of(0))
        with pytest.raises(RecorderError, match="not stored after"):
            recorder.close(0.05)
        late.gate.set()
        for thread in threading.enumerate():
            if thread.name.startswith("recorder"):
                thread.join(DEADLINE_S)
    assert told == [], "the light of the next run may be on"


def test_an_index_out_of_order_is_refused(tmp_path: Path) -> None:
    with RunWriter(tmp_path / "run", HEADER) as writer, Recorder(writer) as recorder:
        recorder.put(shot_of(0))
        with pytest.raises(RecorderError, match="shot 2 is out of order, the next one is 1"):
            recorder.put(shot_of(2))
        recorder.close(DEADLINE_S)
        with pytest.raises(RecorderError, match="after the recorder was closed"):
            recorder.put(shot_of(1))


def test_a_write_error_surfaces_with_its_cause_and_nothing_follows_it(tmp_path: Path) -> None:
    with RunWriter(tmp_path / "run", HEADER) as writer, Recorder(writer, depth=100) as recorder:
        (tmp_path / "run" / "shots" / "2.h5").write_bytes(b"in the way")
        for index in range(10):
            try:
                recorder.put(shot_of(index))
            except RecorderError:
                break
        with pytest.raises(RecorderError, match=r"shot 2 cannot be stored.*2\.h5") as failure:
            recorder.close(DEADLINE_S)
        assert isinstance(failure.value.__cause__, RecorderError)
        with pytest.raises(RecorderError, match="shot 2 cannot be stored"):
            recorder.put(shot_of(10))
    assert not list((tmp_path / "run" / "shots").glob("[3-9].h5"))


RECORD_FOR_EVER = """
import sys
sys.path[:0] = [{tests!r}, {root!r}]
from pathlib import Path
from test_recorder import HEADER, Recorder, RunWriter, shot_of
import threading
room = threading.Semaphore(6)
def committed(shot):
    print(shot.index, flush=True)
    room.release()
with RunWriter(Path(sys.argv[1]), HEADER) as writer, Recorder(writer, on_commit=committed) as recorder:
    for index in range({shots}):
        room.acquire(timeout=1)
        recorder.put(shot_of(index))
"""


def recording_script(shots: int) -> str:
    here = Path(__file__).resolve()
    return RECORD_FOR_EVER.format(tests=str(here.parent), root=str(here.parents[3]), shots=shots)


@pytest.mark.parametrize("shots_before", [1, 23, 60])
def test_every_committed_shot_survives_a_kill(tmp_path: Path, shots_before: int) -> None:
    run_dir = tmp_path / "run"
    with subprocess.Popen(
        [sys.executable, "-c", recording_script(10**6), str(run_dir)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        for _ in range(shots_before):
            last = int(process.stdout.readline())
        assert recover(tmp_path) == [], "it is alive"
        process.kill()
    reader = RunReader(run_dir)
    assert reader.outcome is None
    assert last < reader.shot_count <= last + 10
    for index in range(reader.shot_count):
        assert_stored(run_dir, index)
    with h5py.File(run_dir / "run.h5") as file:
        assert file["/cameras/view2/frames"].shape[0] == reader.shot_count
    recover(tmp_path)
    closed = RunReader(run_dir)
    assert (closed.outcome, closed.cause) == ("interrupted", INTERRUPTED_CAUSE)
    assert not list((run_dir / "shots").glob("*.part"))


def unshare_works() -> bool:
    return subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(not unshare_works(), reason="this machine forbids user namespaces")
def test_a_full_disk_ends_the_run_with_its_reason(tmp_path: Path) -> None:
    """A real, small file system: room for some shots of about 130 kB each, not for 100."""
    script = tmp_path / "record.py"
    script.write_text(recording_script(100))
    (tmp_path / "disk").mkdir()
    commands = (
        'mount -t tmpfs -o size=2m tomoshadow "$1/disk" && '
        '{ "$2" "$1/record.py" "$1/disk/run"; status=$?; cp -r "$1/disk/run" "$1/saved"; exit $status; }'
    )
    process = subprocess.run(
        ["unshare", "-rm", "sh", "-c", commands, "sh", str(tmp_path), sys.executable],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )
    stored = len(process.stdout.split())
    assert process.returncode != 0
    assert f"shot {stored} cannot be stored" in process.stderr
    assert "No space left on device" in process.stderr
    assert stored > 5
    reader = RunReader(tmp_path / "saved")
    assert reader.shot_count == stored
    for index in range(stored):
        assert_stored(tmp_path / "saved", index)
    assert not list((tmp_path / "saved" / "shots").glob("*.part"))
