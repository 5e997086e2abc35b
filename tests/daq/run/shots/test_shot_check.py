"""Missing, unlit and doubly lit exposures are told apart."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.run.shots.shot_check import LightLevels, ShotFindings, Thresholds, check_exposures, light_thresholds, marked
from daq.shot import DoubleFrame, ExposureRecord, Flaw

SHAPE = (200, 48)
THRESHOLDS = {"view1": (LightLevels(20.0), LightLevels(20.0))}


def findings_of(shot: DoubleFrame, thresholds: Thresholds, *, lit: bool = True) -> ShotFindings:
    return check_exposures(marked({"view1": shot}, {"view1": lit}, thresholds))


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
    findings = findings_of(double_frame(*levels, *valid), THRESHOLDS)
    assert findings == expected
    assert findings.good == (expected == ShotFindings())


def test_a_view_that_is_not_lit_may_be_dark_but_not_missing() -> None:
    assert findings_of(double_frame(4, 4), THRESHOLDS, lit=False).good
    assert findings_of(double_frame(4, 0, valid_b=False), THRESHOLDS, lit=False).missing == ("B of view1",)


@pytest.mark.parametrize(
    ("flaw", "text"),
    [
        (Flaw.LOST, "no exposure B of view1"),
        (Flaw.INCOMPLETE, "no exposure B of view1 (incomplete)"),
        (Flaw.WRONG_SIZE, "no exposure B of view1 (of wrong size)"),
        (Flaw.UNPROVEN, "no exposure B of view1 (frames came that are not proven to be it)"),
    ],
)
def test_it_is_told_how_an_exposure_is_missing(flaw: Flaw, text: str) -> None:
    image = np.full(SHAPE, 120, np.uint8)
    shot = DoubleFrame(image, image, ExposureRecord(True), ExposureRecord(False, flaw=flaw))
    assert str(findings_of(shot, THRESHOLDS)) == text


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
    nothing: tuple[str, ...] = ()
    both: tuple[str, ...] = ("A of view1", "B of view1")
    stacks = [(spray, nothing, nothing), (unlit, both, nothing)]
    if dark + 3 + 2 * light <= 245:
        stacks.append((lit + light * scale, nothing, both))
    for stack, dark_ones, bright_ones in stacks:
        images = stack.astype(np.uint16)
        shot = DoubleFrame(images[0], images[1], ExposureRecord(True), ExposureRecord(True))
        findings = findings_of(shot, thresholds)
        assert (findings.unlit, findings.doubly_lit) == (dark_ones, bright_ones)


def test_a_background_near_full_scale_tells_no_double_light() -> None:
    background = np.full((2, *SHAPE), 230.0, np.float32)
    thresholds = light_thresholds({"view1": 8}, {}, {"view1": background})
    assert findings_of(double_frame(255, 255), thresholds).good


def test_a_single_exposure_has_no_frame_b_to_miss() -> None:
    single = DoubleFrame(np.full(SHAPE, 120, np.uint8), None, ExposureRecord(True), ExposureRecord(False))
    assert findings_of(single, THRESHOLDS).good


def test_findings_read_as_a_sentence() -> None:
    misfired = "start of pulse 1 of view2 is missing"
    findings = ShotFindings(("A of view1",), ("B of view2",), ("A of view3",), misfired)
    assert str(findings) == (
        "no exposure A of view1, no light in B of view2, the light of two pulses in A of view3, "
        "fired otherwise: start of pulse 1 of view2 is missing"
    )
