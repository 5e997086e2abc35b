"""Optics against the paper's Table 1 and against the planner of the pulse timing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.errors import PlanError
from daq.run_plan import PulsePair, RunPlan
from daq.timing import CameraTiming, plan_shot_timing
from processing.optics import (
    airy_diameter_um,
    depth_of_field_mm,
    image_scale_px_per_mm,
    resolved_diameter_um,
    straddling_window,
    travel_um,
)


@pytest.mark.parametrize(
    ("f_number", "magnification", "table_um"), [(22, 0.45, 39), (16, 0.43, 28), (16, 0.44, 28), (22, 0.43, 38)]
)
def test_equation_1_reproduces_table_1(f_number: float, magnification: float, table_um: int) -> None:
    assert round(airy_diameter_um(f_number, magnification)) == table_um


@given(st.floats(1.4, 45), st.floats(0.05, 5))
def test_defocus_at_half_the_depth_blurs_one_airy_disk(f_number: float, magnification: float) -> None:
    """A thin lens: the cone of an object point dz out of focus is dz M^2 / (f# (1 + M)) wide on the sensor."""
    dz_um = 1000 * depth_of_field_mm(f_number, magnification) / 2
    blur_um = dz_um * magnification**2 / (f_number * (1 + magnification))
    assert blur_um == pytest.approx(airy_diameter_um(f_number, magnification))


def test_depth_of_field_holds_the_volume_of_the_paper() -> None:
    assert depth_of_field_mm(16, 0.43) > 6
    assert depth_of_field_mm(22, 0.43) > 10


def test_scale_and_smallest_droplet_of_the_paper() -> None:
    assert image_scale_px_per_mm(0.444, 7.4) == pytest.approx(60)
    assert resolved_diameter_um(16, 0.43) == pytest.approx(65, abs=1)


def test_a_droplet_of_30_m_s_moves_30_um_in_a_pulse_and_192_um_between_two() -> None:
    assert travel_um(30, 1000) == 30
    assert travel_um(30, 6400) == 192


timings = st.builds(
    CameraTiming,
    trigger_delay_ns=st.integers(0, 3000),
    exposure_a_ns=st.integers(3000, 20_000),
    gap_ns=st.integers(0, 3000),
    exposure_b_ns=st.integers(3000, 200_000),
    readout_ns=st.just(1000),
    guard_ns=st.integers(0, 400),
)


@given(timings, st.integers(250, 2000), st.integers(2000, 200_000))
def test_the_planner_accepts_exactly_the_window(camera: CameraTiming, width_ns: int, separation_ns: int) -> None:
    window = straddling_window(
        width_ns=width_ns,
        exposure_a_ns=camera.exposure_a_ns,
        gap_ns=camera.gap_ns,
        exposure_b_ns=camera.exposure_b_ns,
        guard_ns=camera.guard_ns,
    )
    pulse = PulsePair(width_ns=width_ns, separation_ns=separation_ns, current_a={"view1": 1.0})
    try:
        plan_shot_timing(RunPlan(name="t", shots=1, pulse=pulse), {"view1": camera})
        accepted = True
    except PlanError:
        accepted = False
    assert accepted == (window.shortest_ns <= separation_ns <= window.longest_ns)


def test_a_pulse_longer_than_the_exposure_is_refused_with_both_values() -> None:
    with pytest.raises(ValueError, match=r"2000 ns and 2 x guard 200 ns .* 2100 ns"):
        straddling_window(width_ns=2000, exposure_a_ns=2100, gap_ns=1, exposure_b_ns=9000, guard_ns=200)
