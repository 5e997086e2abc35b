"""Dark and background images are those of the same camera, told the same."""

from pathlib import Path
from typing import Any

import pytest

from daq.errors import DeviceRefused
from daq.files.run_directory import RunHeader, RunWriter
from daq.run.references import require_same_cameras
from tests.daq.files.test_run_directory import header_of


def header_with(gain: float | None, exposure_b_ns: int = 30_000_000, first: str = "TriggerMode") -> RunHeader:
    """Of a run whose view1 was told a gain; None: from before runs kept what cameras are told."""
    told = {"Gain": gain, "TriggerMode": "On"}
    features = [{"feature": name, "value": told[name]} for name in sorted(told, key=lambda name: name != first)]
    profile: dict[str, Any] = {"features": features, "timing": {"exposure_b_ns": exposure_b_ns, "guard_ns": 200}}
    configuration = {} if gain is None else {"camera_profiles": {"view1": profile}}
    return header_of().model_copy(update={"configuration": configuration})


@pytest.mark.parametrize(
    ("header", "difference"),
    [
        (header_with(2.0), "Gain = 1.0 then, Gain = 2.0 now"),
        (header_with(1.0, 60_000_000), "exposure_b_ns = 30000000 then, exposure_b_ns = 60000000 now"),
    ],
)
def test_a_reference_for_which_a_camera_was_told_otherwise_is_refused_with_the_difference(
    tmp_path: Path, header: RunHeader, difference: str
) -> None:
    with RunWriter(tmp_path / "dark", header_with(1.0)):
        pass
    told = ""
    try:
        require_same_cameras([tmp_path / "dark"], header, {})
    except DeviceRefused as error:
        told = str(error)
    assert told.startswith("view1: ")
    assert difference in told


@pytest.mark.parametrize("header", [header_with(1.0), header_with(None), header_with(1.0, first="Gain")])
def test_what_is_the_same_or_not_known_is_no_difference(tmp_path: Path, header: RunHeader) -> None:
    with RunWriter(tmp_path / "dark", header_with(1.0)):
        pass
    require_same_cameras([tmp_path / "dark"], header, {})
