import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.drivers.camera_profile import PairSpacing
from daq.drivers.exposure_pairing import Arrival, ExposureFormat, double_frame, frame_id_distance, place_exposures
from daq.simulation.camera.gige_stream import next_block_id

SHAPE = (3, 4)
FORM = ExposureFormat(SHAPE, 8, 2, PairSpacing(spacing_ns=8500, tolerance_ns=100))

frame_ids = st.integers(1, 65535)


def arrival(frame_id: int, stamp_ns: int = 1_000_000, *, whole: bool = True) -> Arrival:
    return Arrival(frame_id, stamp_ns, np.full(SHAPE, frame_id % 251 + 1, np.uint8) if whole else None)


def pair(first_id: int, spacing_ns: int = 8500) -> list[Arrival]:
    return [arrival(first_id), arrival(next_block_id(first_id), 1_000_000 + spacing_ns)]


@given(frame_ids, st.integers(0, 1000))
def test_distance_counts_the_frames_between_two_ids_across_the_wrap(first: int, steps: int) -> None:
    last = first
    for _ in range(steps):
        last = next_block_id(last)
    assert 1 <= last <= 65535
    assert frame_id_distance(first, last) == steps


def test_the_first_frame_of_an_acquisition_is_one_from_the_start() -> None:
    assert frame_id_distance(0, 1) == 1


@given(frame_ids, st.one_of(st.none(), frame_ids))
def test_neighbours_are_a_and_b_whatever_was_before(first_id: int, last_id: int | None) -> None:
    arrivals = pair(first_id)
    assert place_exposures(arrivals, last_id, 2) == arrivals
    assert double_frame(arrivals, last_id, FORM).valid


@given(frame_ids, st.integers(0, 1))
def test_a_lone_frame_keeps_its_slot_after_a_complete_shot(last_id: int, lost: int) -> None:
    arrivals = pair(next_block_id(last_id))
    left = arrivals[1 - lost]
    shot = double_frame([left], last_id, FORM)
    records = (shot.record_a, shot.record_b)
    assert [record.valid for record in records] == [lost == 1, lost == 0]
    assert records[1 - lost].frame_id == left.frame_id
    assert shot.frame_b is not None
    np.testing.assert_array_equal((shot.frame_a, shot.frame_b)[1 - lost], left.image)
    assert not (shot.frame_a, shot.frame_b)[lost].any()


@given(frame_ids, st.one_of(st.none(), frame_ids))
def test_a_lone_frame_is_never_taken_on_trust(frame_id: int, last_id: int | None) -> None:
    shot = double_frame([arrival(frame_id)], last_id, FORM)
    proven = last_id is not None and frame_id_distance(last_id, frame_id) in (1, 2)
    assert (shot.record_a.valid or shot.record_b.valid) == proven


@given(frame_ids, st.integers(2, 65533))
def test_frames_that_are_no_neighbours_are_no_pair(first_id: int, distance: int) -> None:
    second_id = (first_id - 1 + distance) % 65535 + 1
    shot = double_frame([arrival(first_id), arrival(second_id, 1_008_500)], None, FORM)
    assert not shot.record_a.valid
    assert not shot.record_b.valid


@given(frame_ids)
def test_two_firings_in_one_shot_prove_nothing(first_id: int) -> None:
    arrivals = [*pair(first_id), arrival(next_block_id(next_block_id(first_id)))]
    assert place_exposures(arrivals, first_id, 2) == [None, None]


@given(st.integers(-1_000_000, 1_000_000))
def test_the_spacing_of_the_stamps_decides(spacing_ns: int) -> None:
    assert double_frame(pair(7, spacing_ns), 6, FORM).valid == (8400 <= spacing_ns <= 8600)


@pytest.mark.parametrize(("spacing_ns", "valid"), [(0, True), (30_000_000, True), (-1, False)])
def test_stamps_without_a_known_spacing_still_tell_the_order(spacing_ns: int, valid: bool) -> None:
    form = ExposureFormat(SHAPE, 8, 2, None)
    assert double_frame(pair(7, spacing_ns), 6, form).valid == valid


def test_an_incomplete_frame_is_black_and_leaves_its_partner_alone() -> None:
    incomplete = Arrival(2, 0, None, missing_packets=3, resent_packets=1)
    shot = double_frame([arrival(1), incomplete], 0, FORM)
    assert shot.record_a.valid
    assert shot.frame_b is not None
    assert not shot.frame_b.any()
    assert not shot.record_b.valid
    assert (shot.record_b.missing_packets, shot.record_b.resent_packets) == (3, 1)


@pytest.mark.parametrize(("bits", "dtype"), [(8, np.uint8), (12, np.uint16), (16, np.uint16)])
def test_a_missing_exposure_has_shape_and_type_of_an_image(bits: int, dtype: type[np.generic]) -> None:
    form = ExposureFormat(SHAPE, bits, 2, None)
    shot = double_frame([], None, form)
    memory = np.arange(form.blank().nbytes, dtype=np.uint8)
    for image in (shot.frame_a, shot.frame_b, form.image_of(memory)):
        assert image is not None
        assert image.shape == SHAPE
        assert image.dtype == dtype


def test_a_single_exposure_has_no_frame_b() -> None:
    form = ExposureFormat(SHAPE, 8, 1, None)
    shot = double_frame([arrival(1)], 0, form)
    assert shot.frame_b is None
    assert shot.valid


@given(frame_ids, st.one_of(st.none(), frame_ids), st.booleans())
def test_stacked_exposures_come_and_go_together(frame_id: int, last_id: int | None, whole: bool) -> None:
    rows, columns = SHAPE
    image = np.arange(2 * rows * columns, dtype=np.uint8).reshape(2 * rows, columns)
    stacked = ExposureFormat(SHAPE, 8, 2, None, stacked=True)
    shot = double_frame([Arrival(frame_id, 1_000_000, image if whole else None)], last_id, stacked)
    assert shot.frame_b is not None
    assert (shot.record_a.valid, shot.record_b.valid) == (whole, whole)
    np.testing.assert_array_equal(np.concatenate([shot.frame_a, shot.frame_b]), image if whole else 0 * image)


def test_two_frames_for_one_stacked_pair_are_not_trusted() -> None:
    image = np.ones((6, 4), np.uint8)
    arrivals = [Arrival(number, 1_000_000, image) for number in (1, 2)]
    shot = double_frame(arrivals, None, ExposureFormat(SHAPE, 8, 2, None, stacked=True))
    assert not shot.valid
