"""Missing, unlit and doubly lit exposures are told apart."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.run.shot_check import ShotFindings, check_exposures, light_thresholds
from daq.shot import DoubleFrame, ExposureRecord

SHAPE = (200, 48)
THRESHOLDS = {"view1": (20.0, 20.0)}


def double_frame(level_a: float, level_b: float, valid_a: bool = True, valid_b: bool = True) -> DoubleFrame:
    images = [np.full(SHAPE, level, np.uint8) for level in (level_a, level_b)]
    return DoubleFrame(images[0], images[1], ExposureRecord(valid_a), ExposureRecord(valid_b))


@pytest.mark.parametrize(
    ("levels", "valid", "expected"),
    [
        ((120, 120), (True, True), ShotFindings()),
        ((120, 4), (True, True), ShotFindings(unlit=("B of view1",))),
        ((4, 120), (True, True), ShotFindings(unlit=("A of view1",))),
        ((4, 4), (True, True), ShotFindings(unlit=("A of view1", "B of view1"))),
        ((120, 0), (True, False), ShotFindings(missing=("B of view1",))),
        ((0, 4), (False, True), ShotFindings(missing=("A of view1",), unlit=("B of view1",))),
    ],
)
def test_each_fault_has_its_name(levels: tuple[int, int], valid: tuple[bool, bool], expected: ShotFindings) -> None:
    findings = check_exposures({"view1": double_frame(*levels, *valid)}, {"view1": True}, THRESHOLDS)
    assert findings == expected
    assert findings.good == (expected == ShotFindings())


def test_a_view_that_is_not_lit_may_be_dark_but_not_missing() -> None:
    dark = {"view1": double_frame(4, 4)}
    assert check_exposures(dark, {"view1": False}, THRESHOLDS).good
    lost = {"view1": double_frame(4, 0, valid_b=False)}
    assert check_exposures(lost, {"view1": False}, THRESHOLDS).missing == ("B of view1",)


@given(
    dark=st.integers(0, 60), light=st.integers(30, 190), covered=st.floats(0, 0.8), bits=st.sampled_from([8, 12, 16])
)
def test_references_tell_light_from_dark_at_any_exposure(dark: int, light: int, covered: float, bits: int) -> None:
    """Also behind a spray that covers most of the image, and for a frame B that sees more ambient light."""
    scale = 2 ** (bits - 8)
    unlit = np.full((2, *SHAPE), dark * scale, np.float32)
    unlit[1] += 3 * scale
    lit = unlit + light * scale
    thresholds = light_thresholds({"view1": bits}, {"view1": unlit}, {"view1": lit})
    spray = lit.copy()
    spray[:, : int(covered * SHAPE[0])] = unlit[:, : int(covered * SHAPE[0])]
    for stack, expected in ((spray, ()), (unlit, ("A of view1", "B of view1"))):
        images = stack.astype(np.uint16)
        shot = DoubleFrame(images[0], images[1], ExposureRecord(True), ExposureRecord(True))
        assert check_exposures({"view1": shot}, {"view1": True}, thresholds).unlit == expected


def test_a_single_exposure_has_no_frame_b_to_miss() -> None:
    single = DoubleFrame(np.full(SHAPE, 120, np.uint8), None, ExposureRecord(True), ExposureRecord(False))
    assert check_exposures({"view1": single}, {"view1": True}, THRESHOLDS).good


def test_findings_read_as_a_sentence() -> None:
    findings = ShotFindings(("A of view1",), ("B of view2",), "start of pulse 1 of view2 is missing")
    assert str(findings) == (
        "no exposure A of view1, no light in B of view2, fired otherwise: start of pulse 1 of view2 is missing"
    )
