"""The data contract: what is written is read, damage is found, and any HDF5 reader sees the run."""

import os
import shutil
import zlib
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from daq.files.run_directory import (
    DoubleFrame,
    ExposureRecord,
    FiredTrain,
    ImageKey,
    LightPulse,
    PulsePair,
    RecorderError,
    RunHeader,
    RunPlan,
    RunReader,
    RunWriter,
    Shot,
    ShotFileError,
    ViewFormat,
    list_runs,
    pack,
)

FORMATS = {"view1": ViewFormat((12, 16), 8), "view2": ViewFormat((9, 20), 12)}


def header_of(views: Mapping[str, ViewFormat] = FORMATS, frames: int = 2) -> RunHeader:
    plan = RunPlan(name="spray", shots=3, pulse=PulsePair(current_a=dict.fromkeys(views, 12.0)))
    return RunHeader(
        run_id="20261122T101530-spray",
        created_utc="2026-11-22T10:15:30+00:00",
        views=dict(views),
        frames_per_shot=2 if frames == 2 else 1,
        plan=plan,
        configuration={"rig": {"name": "bench", "views": list(views)}},
        devices={"view1": {"vendor": "JAI", "serial": "1"}},
        software={"numpy": np.__version__},
        calibration_id="c1",
        calibration_sha256="00ff",
        separation_ns=6400 if frames == 2 else None,
    )


def shot_of(header: RunHeader, index: int, seed: int = 0) -> Shot:
    rng = np.random.default_rng((seed, index))

    def image(view: ViewFormat) -> np.ndarray:
        return rng.integers(0, 2**view.bits, view.shape).astype(view.dtype)

    def record(number: int) -> ExposureRecord:
        return ExposureRecord(True, 2 * index + number, 10**15 + index, number, 7)

    views = {}
    for name, view in header.views.items():
        double = header.frames_per_shot == 2
        last = record(2) if double else ExposureRecord(valid=False)
        views[name] = DoubleFrame(image(view), image(view) if double else None, record(1), last)
    pulses = {name: (LightPulse(104, 1000, 12.5), LightPulse(6504, 1000, 12.5)) for name in header.views}
    fired = FiredTrain(index + 40, dict.fromkeys(header.views, -64), pulses)
    return Shot(index, ImageKey.SAMPLE, views, fired, 1_800_000_000_000_000_000 + index, 0.5 * index)


def assert_same(read: Shot, written: Shot) -> None:
    for view, expected in written.views.items():
        found = read.views[view]
        assert (found.record_a, found.record_b) == (expected.record_a, expected.record_b)
        np.testing.assert_array_equal(found.frame_a, expected.frame_a)
        assert found.frame_a.dtype == expected.frame_a.dtype
        assert (found.frame_b is None) == (expected.frame_b is None)
        if found.frame_b is not None and expected.frame_b is not None:
            np.testing.assert_array_equal(found.frame_b, expected.frame_b)
    facts = [(s.index, s.image_key, s.fired, s.host_time_ns, s.stage_z_mm, set(s.views)) for s in (read, written)]
    assert facts[0] == facts[1]


def write_run(run_dir: Path, count: int = 3, header: RunHeader | None = None) -> RunHeader:
    header = header or header_of()
    with RunWriter(run_dir, header) as writer:
        for index in range(count):
            writer.write_shot(shot_of(header, index))
    return header


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    shapes=st.lists(
        st.tuples(st.integers(1, 17), st.integers(1, 19), st.sampled_from([8, 10, 12, 16])), min_size=2, max_size=8
    ),
    frames=st.sampled_from([1, 2]),
)
def test_any_format_round_trips(
    tmp_path_factory: pytest.TempPathFactory, shapes: list[tuple[int, int, int]], frames: int
) -> None:
    views = {f"view{n}": ViewFormat((rows, columns), bits) for n, (rows, columns, bits) in enumerate(shapes)}
    header = header_of(views, frames)
    run_dir = tmp_path_factory.mktemp("any") / "run"
    write_run(run_dir, 2, header)
    with RunReader(run_dir) as reader:
        assert reader.header == header
        for index in range(2):
            assert_same(reader.read_shot(index), shot_of(header, index))


def test_what_is_unknown_stays_unknown(tmp_path: Path) -> None:
    header = header_of()
    whole = shot_of(header, 0)
    lost = DoubleFrame(
        np.zeros((12, 16), np.uint8), np.zeros((12, 16), np.uint8), ExposureRecord(False), ExposureRecord(False)
    )
    shot = Shot(0, ImageKey.INVALID, {**whole.views, "view1": lost})
    with RunWriter(tmp_path / "run", header) as writer:
        writer.write_shot(shot)
    assert_same(RunReader(tmp_path / "run").read_shot(0), shot)


def test_plain_h5py_sees_the_run_grow(tmp_path: Path) -> None:
    header = header_of()
    with RunWriter(tmp_path / "run", header) as writer:
        for index in range(3):
            writer.write_shot(shot_of(header, index))
            with h5py.File(tmp_path / "run" / "run.h5") as file:
                frames = file["/cameras/view1/frames"]
                assert frames.shape == (index + 1, 2, 12, 16)
                np.testing.assert_array_equal(frames[index, 1], shot_of(header, index).views["view1"].frame_b)
    with h5py.File(tmp_path / "run" / "run.h5") as file:
        np.testing.assert_array_equal(file["/shots/sequence"], [40, 41, 42])
        np.testing.assert_array_equal(file["/shots/stage_z_mm"], [0, 0.5, 1])
        np.testing.assert_array_equal(file["/cameras/view2/valid"], np.ones((3, 2), bool))
        np.testing.assert_array_equal(file["/cameras/view2/pulse_start_ns"][2], [104, 6504, 0, 0])
        frame = file["/cameras/view2/frames"][1, 0]
        assert file["/cameras/view2/crc32"][1, 0] == zlib.crc32(frame.tobytes())


def test_every_number_has_a_unit_and_nexus_finds_its_way(tmp_path: Path) -> None:
    write_run(tmp_path / "run", 1)
    lacking: list[str] = []

    def visit(name: str, found: h5py.Group | h5py.Dataset) -> None:
        number = isinstance(found, h5py.Dataset) and found.dtype.kind != "O"
        group = isinstance(found, h5py.Group)
        if (group and "NX_class" not in found.attrs) or (number and "units" not in found.attrs):
            lacking.append(name)

    for name, version in (("run.h5", 1), ("shots/0.h5", 2)):
        with h5py.File(tmp_path / "run" / name) as file:
            file.visititems(visit)
            assert file.attrs["schema_version"] == version
    assert not lacking
    with h5py.File(tmp_path / "run" / "run.h5") as file:
        data = file[file.attrs["default"]][file["entry"].attrs["default"]]
        assert data.attrs["NX_class"] == "NXdata"
        assert data[data.attrs["signal"]].shape == (1, 2, 12, 16)
        assert file["entry/instrument/view1"].attrs["NX_class"] == "NXdetector"


def test_outcome_is_written_once_and_an_open_run_has_none(tmp_path: Path) -> None:
    header = header_of()
    with RunWriter(tmp_path / "run", header) as writer:
        assert RunReader(tmp_path / "run").outcome is None
        writer.write_shot(shot_of(header, 0))
        writer.finish("failed", "view2: no answer")
        reader = RunReader(tmp_path / "run")
        assert (reader.outcome, reader.cause) == ("failed", "view2: no answer")
        with pytest.raises(RecorderError, match="has an outcome already, failed"):
            writer.finish("completed")
    with h5py.File(tmp_path / "run" / "run.h5") as file:
        assert file["/cameras/view1/frames"].shape[0] == 1


@pytest.mark.parametrize("when", ["before the shots", "after the shots"])
def test_references_round_trip_whenever_they_are_written(tmp_path: Path, when: str) -> None:
    header = header_of()
    rng = np.random.default_rng(1)
    dark = {name: rng.normal(10, 1, (2, *view.shape)).astype(np.float32) for name, view in FORMATS.items()}
    background = {"view2": dark["view2"] + 100}
    with RunWriter(tmp_path / "run", header) as writer:
        if when == "before the shots":
            writer.write_references(dark, background)
        writer.write_shot(shot_of(header, 0))
        if when == "after the shots":
            writer.write_references(dark, background)
        with pytest.raises(RecorderError, match=r"dark of view1.*already"):
            writer.write_references(dark, {})
        with pytest.raises(RecorderError, match=r"dark of view1 has shape \(12, 16\)"):
            writer.write_references({"view1": dark["view1"][0]}, {})
    with RunReader(tmp_path / "run") as reader:
        for view, expected in dark.items():
            np.testing.assert_array_equal(reader.dark(view), expected)
        np.testing.assert_array_equal(reader.background("view2"), background["view2"])
        assert reader.background("view1") is None
        with pytest.raises(ShotFileError, match="view9"):
            reader.dark("view9")


def test_a_damaged_reference_is_told(tmp_path: Path) -> None:
    run_dir = tmp_path / "run"
    dark = {name: np.full((2, *view.shape), 7, np.float32) for name, view in FORMATS.items()}
    with RunWriter(run_dir, header_of()) as writer:
        writer.write_references(dark, {})
    with h5py.File(run_dir / "run.h5", "r+") as file:
        stored = file["/cameras/view1/dark"].id
        chunk = bytearray(stored.read_direct_chunk((1, 0, 0))[1])
        chunk[len(chunk) // 2] ^= 0x10
        stored.write_direct_chunk((1, 0, 0), bytes(chunk))
    with pytest.raises(ShotFileError, match=r"run\.h5: cannot be read: it is torn or damaged: copy it back"):
        RunReader(run_dir).dark("view1")
    np.testing.assert_array_equal(RunReader(run_dir).dark("view2"), dark["view2"])


def test_exposure_b_is_absent_where_it_was_not_asked_for(tmp_path: Path) -> None:
    header, path = write_run(tmp_path / "run", 1), tmp_path / "run" / "shots" / "0.h5"
    with h5py.File(path, "r+") as file:
        file["/cameras/view1/frames"].id.write_direct_chunk((0, 1, 0, 0), b"no exposure B")
    with pytest.raises(ShotFileError, match="exposure B of view1"):
        RunReader(tmp_path / "run").read_shot(0)
    seen, whole = RunReader(tmp_path / "run").read_shot(0, "a").views["view1"], shot_of(header, 0).views["view1"]
    np.testing.assert_array_equal(seen.frame_a, whole.frame_a)
    assert seen.frame_b is None
    assert (seen.record_a, seen.valid) == (whole.record_a, True)


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    header = write_run(tmp_path / "run", 1)
    with pytest.raises(RecorderError, match="never overwritten"), RunWriter(tmp_path / "run", header):
        pass
    assert_same(RunReader(tmp_path / "run").read_shot(0), shot_of(header, 0))
    writer = RunWriter(tmp_path / "run", header)
    with pytest.raises(RecorderError, match=r"0\.h5: exists already"):
        writer.write_shot(shot_of(header, 0, seed=9))
    assert_same(RunReader(tmp_path / "run").read_shot(0), shot_of(header, 0))


def test_a_torn_shot_is_named_and_the_others_stay_readable(tmp_path: Path) -> None:
    header = write_run(tmp_path / "run")
    torn = tmp_path / "run" / "shots" / "1.h5"
    os.truncate(torn, torn.stat().st_size // 2)
    (tmp_path / "run" / "shots" / "3.h5.part").write_bytes(b"in flight")
    with RunReader(tmp_path / "run") as reader:
        assert reader.shot_count == 3
        with pytest.raises(ShotFileError, match=r"1\.h5: cannot be read: it is torn or damaged: copy it back"):
            reader.read_shot(1)
        assert_same(reader.read_shot(0), shot_of(header, 0))
        assert_same(reader.read_shot(2), shot_of(header, 2))
        assert reader.image_keys().tolist() == [0, 3, 0]


def test_a_shot_that_vanished_keeps_its_slot(tmp_path: Path) -> None:
    write_run(tmp_path / "run")
    (tmp_path / "run" / "shots" / "1.h5").unlink()
    reader = RunReader(tmp_path / "run")
    assert reader.shot_count == 3
    with pytest.raises(ShotFileError, match=r"1\.h5"):
        reader.read_shot(1)


def test_a_shot_of_another_run_is_refused(tmp_path: Path) -> None:
    write_run(tmp_path / "run", 1)
    write_run(tmp_path / "other", 2, header_of().model_copy(update={"run_id": "other"}))
    shutil.copy(tmp_path / "other" / "shots" / "1.h5", tmp_path / "run" / "shots" / "1.h5")
    with pytest.raises(ShotFileError, match="not a shot of run"):
        RunReader(tmp_path / "run").read_shot(1)


@pytest.fixture(scope="module")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run_dir = tmp_path_factory.mktemp("pristine") / "run"
    write_run(run_dir, 1)
    return run_dir


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_never_gives_other_data(pristine: Path, where: float, bit: int) -> None:
    header = header_of()
    path = pristine / "shots" / "0.h5"
    sound = path.read_bytes()
    damaged = bytearray(sound)
    damaged[int(where * len(sound))] ^= 1 << bit
    path.write_bytes(damaged)
    try:
        assert_same(RunReader(pristine).read_shot(0), shot_of(header, 0))
    except ShotFileError:
        pass
    finally:
        path.write_bytes(sound)


def test_a_flipped_bit_in_a_frame_is_detected(pristine: Path) -> None:
    path = pristine / "shots" / "0.h5"
    sound = path.read_bytes()
    with h5py.File(path) as file:
        chunk = file["/cameras/view2/frames"].id.get_chunk_info(1)
    for offset in range(chunk.byte_offset, chunk.byte_offset + chunk.size, 37):
        damaged = bytearray(sound)
        damaged[offset] ^= 0x10
        path.write_bytes(damaged)
        with pytest.raises(ShotFileError, match=r"0\.h5"):
            RunReader(pristine).read_shot(0)
    path.write_bytes(sound)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"view1": ((12, 16), np.uint16)}, "view1: frame"),
        ({"view2": ((9, 21), np.uint16)}, "view2: frame"),
    ],
)
def test_a_shot_of_another_format_is_refused(
    tmp_path: Path, change: dict[str, tuple[tuple[int, int], type]], message: str
) -> None:
    header = header_of()
    shot = shot_of(header, 0)
    views = dict(shot.views)
    for view, (shape, dtype) in change.items():
        images: np.ndarray = np.zeros((2, *shape), dtype)
        views[view] = DoubleFrame(images[0], images[1], ExposureRecord(True), ExposureRecord(True))
    with RunWriter(tmp_path / "run", header) as writer:
        with pytest.raises(RecorderError, match=message):
            writer.write_shot(Shot(0, ImageKey.SAMPLE, views))
        with pytest.raises(RecorderError, match="views"):
            writer.write_shot(Shot(0, ImageKey.SAMPLE, {"view1": shot.views["view1"]}))
        pulses = {"view1": (LightPulse(0, 1, 1.0),) * 5}
        with pytest.raises(RecorderError, match="5 light pulses"):
            writer.write_shot(Shot(0, ImageKey.SAMPLE, shot.views, FiredTrain(1, {}, pulses)))


def test_packed_run_is_plain_and_the_same(tmp_path: Path) -> None:
    header = header_of()
    with RunWriter(tmp_path / "run", header) as writer:
        for index in range(3):
            writer.write_shot(shot_of(header, index))
        writer.write_references({"view1": np.ones((2, 12, 16), np.float32)}, {})
        writer.finish("completed")
    out = tmp_path / "packed.h5"
    pack(tmp_path / "run", out)
    shutil.move(tmp_path / "run" / "shots", tmp_path / "away")
    with h5py.File(out) as packed:
        for index in range(3):
            expected = shot_of(header, index).views["view2"]
            np.testing.assert_array_equal(packed["/cameras/view2/frames"][index], [expected.frame_a, expected.frame_b])
        np.testing.assert_array_equal(packed["/shots/sequence"], [40, 41, 42])
        assert packed["entry/outcome"].asstr()[()] == "completed"
        assert packed["/cameras/view1/dark"][:].mean() == 1
        assert packed["entry/data_view1/frames"].shape == (3, 2, 12, 16)
    with pytest.raises(RecorderError, match="exists already"):
        pack(tmp_path / "run", out)


def test_an_empty_run_can_be_packed(tmp_path: Path) -> None:
    header = write_run(tmp_path / "run", 0)
    try:
        pack(tmp_path / "run", tmp_path / "packed.h5")
    except ValueError as error:
        pytest.fail(f"an empty run is not packed: {error}")
    with h5py.File(tmp_path / "packed.h5") as packed:
        for view, view_format in header.views.items():
            assert packed[f"/cameras/{view}/frames"].shape == (0, 2, *view_format.shape)
        assert packed["/shots/index"].shape == (0,)


def test_a_run_whose_shots_were_taken_away_says_so_instead_of_counting_none(tmp_path: Path) -> None:
    write_run(tmp_path / "run", 1)
    shutil.rmtree(tmp_path / "run" / "shots")
    with pytest.raises(ShotFileError, match="no folder shots"):
        _ = RunReader(tmp_path / "run").shot_count


def test_packing_a_torn_run_leaves_nothing(tmp_path: Path) -> None:
    write_run(tmp_path / "run")
    os.truncate(tmp_path / "run" / "shots" / "2.h5", 100)
    with pytest.raises(ShotFileError, match=r"2\.h5"):
        pack(tmp_path / "run", tmp_path / "packed.h5")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_runs_are_listed_in_order_of_time(tmp_path: Path) -> None:
    assert list_runs(tmp_path) == ()
    for name in ("20261122T101531-b", "20261122T101530-a"):
        write_run(tmp_path / name, 0)
    (tmp_path / "calibrations").mkdir()
    assert [path.name for path in list_runs(tmp_path)] == ["20261122T101530-a", "20261122T101531-b"]


@pytest.mark.parametrize("damage", ["missing", "torn", "newer", "foreign"])
def test_an_unreadable_run_is_named(tmp_path: Path, damage: str) -> None:
    write_run(tmp_path / "run", 1)
    path = tmp_path / "run" / "run.h5"
    if damage == "missing":
        path.unlink()
    elif damage == "torn":
        os.truncate(path, 3000)
    else:
        with h5py.File(path, "r+") as file:
            file.attrs.update({"schema_version": 2} if damage == "newer" else {"schema": "something"})
    with pytest.raises(ShotFileError, match=r"run\.h5"), RunReader(tmp_path / "run"):
        pass


def test_a_run_that_cannot_begin_leaves_nothing_whatever_the_reason(tmp_path: Path) -> None:
    """HDF5 takes no NUL, and says so by a ValueError."""
    with pytest.raises(ValueError, match="NULL"):
        RunWriter(tmp_path / "run", header_of().model_copy(update={"created_utc": "\0"})).open()
    assert not (tmp_path / "run").exists()
