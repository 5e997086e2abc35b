"""Time from A to B: as fired, else as stated, else unknown with a reason."""

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from daq.files.run_directory import (
    DoubleFrame,
    ExposureRecord,
    FiredTrain,
    ImageKey,
    LightPulse,
    RunHeader,
    RunReader,
    RunWriter,
    Shot,
    ViewFormat,
)
from processing.geometry import FloatArray
from processing.runs.shots.separation import Separation, separation_of

PULSES = (LightPulse(1000, 1000, 10.0), LightPulse(7400, 1000, 10.0))


def separation(
    run_dir: Path,
    pulses: dict[str, Any] | None,
    stated_ns: int | None,
    frames: Literal[1, 2] = 2,
    images: tuple[FloatArray, FloatArray] = (np.zeros((4, 4)), np.zeros((4, 4))),
) -> Separation | str:
    """Of a run with one shot, as its files have it."""
    header = RunHeader(
        run_id="run",
        created_utc="2026-01-01T00:00:00+00:00",
        views={name: ViewFormat((4, 4), 8) for name in ("view1", "view2")},
        frames_per_shot=frames,
        separation_ns=stated_ns,
    )
    first, second = (image.astype(np.uint8) for image in images)
    record = ExposureRecord(valid=True, frame_id=1, device_timestamp_ns=1)
    views = {name: DoubleFrame(first, second if frames == 2 else None, record, record) for name in header.views}
    fired = FiredTrain(1, {}, pulses) if pulses is not None else None
    with RunWriter(run_dir, header) as writer:
        writer.write_shot(Shot(0, ImageKey.SAMPLE, views, fired))
        writer.finish("completed")
    with RunReader(run_dir) as run:
        return separation_of(run, run.read_shot(0))


def test_pulses_as_fired_come_before_what_was_asked_for(tmp_path: Path) -> None:
    other = (LightPulse(1000, 1000, 10.0), LightPulse(7400, 1080, 10.0))
    found = separation(tmp_path / "run", {"view1": PULSES, "view2": other}, 9999)
    assert found == Separation(6420.0, 40.0, "fired")


def test_views_that_were_not_lit_have_no_say(tmp_path: Path) -> None:
    assert separation(tmp_path / "run", {"view1": PULSES}, 9999) == Separation(6400.0, 0.0, "fired")


def test_without_pulses_it_is_as_stated(tmp_path: Path) -> None:
    assert separation(tmp_path / "run", None, 6400) == Separation(6400.0, 0.0, "stated")


@pytest.mark.parametrize(
    ("pulses", "stated_ns", "frames", "reason"),
    [
        (None, None, 2, "nobody knows the time from exposure A to B"),
        (None, None, 1, "one exposure"),
        ({"view1": PULSES[:1], "view2": PULSES}, 6400, 2, "views were lit 1 times"),
        (None, -6400, 2, "B comes -6400 ns after A"),
        ({"view1": PULSES[::-1]}, 6400, 2, "B comes -6400 ns after A"),
        ({"view1": PULSES, "view2": PULSES[:1] * 2}, 6400, 2, "B comes 0 to 6400 ns after A"),
        ({"view1": PULSES, "view2": (*PULSES, LightPulse(9000, 100, 1.0))}, 6400, 2, "views were lit 3 times"),
    ],
)
def test_an_unknown_separation_has_a_reason(
    tmp_path: Path, pulses: dict[str, Any] | None, stated_ns: int | None, frames: Literal[1, 2], reason: str
) -> None:
    found = separation(tmp_path / "run", pulses, stated_ns, frames)
    assert isinstance(found, str)
    assert reason in found


@pytest.mark.parametrize("stated_ns", [None, 6400])
def test_an_exposure_that_is_a_copy_of_the_other_has_no_time_of_its_own(tmp_path: Path, stated_ns: int | None) -> None:
    """Droplets would stand still, however well their backgrounds differ."""
    image = np.arange(16.0).reshape(4, 4)
    copied = separation(tmp_path / "copied", {"view1": PULSES}, stated_ns, images=(image, image))
    assert str(copied).startswith("exposure B of view1, view2 has the very pixels of A")
    assert isinstance(separation(tmp_path / "two", {"view1": PULSES}, stated_ns, images=(image, image.T)), Separation)
