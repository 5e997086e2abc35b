"""Optics against the paper's Table 1."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from processing.optics import (
    airy_diameter_um,
    depth_of_field_mm,
    image_scale_px_per_mm,
    resolved_diameter_um,
    smallest_droplet_um,
    travel_um,
)
from processing.synthetic.paper_rig import TABLE_1


@pytest.mark.parametrize("view", TABLE_1)
def test_equation_1_reproduces_table_1(view: str) -> None:
    row = TABLE_1[view]
    assert round(airy_diameter_um(row.f_number, row.magnification)) == row.airy_diameter_um


@given(st.floats(1.4, 45), st.floats(0.05, 5))
def test_defocus_at_half_the_depth_blurs_one_airy_disk(f_number: float, magnification: float) -> None:
    """A thin lens: the cone of an object point dz out of focus is dz M^2 / (f# (1 + M)) wide on the sensor."""
    dz_um = 1000 * depth_of_field_mm(f_number, magnification) / 2
    blur_um = dz_um * magnification**2 / (f_number * (1 + magnification))
    assert blur_um == pytest.approx(airy_diameter_um(f_number, magnification))


def test_depth_of_field_holds_the_volume_of_the_paper() -> None:
    assert depth_of_field_mm(16, 0.43) > 6
    assert depth_of_field_mm(22, 0.43) > 10


@pytest.mark.parametrize("view", TABLE_1)
def test_the_smallest_droplet_is_as_dark_as_simulated_ones_that_are_found(view: str) -> None:
    """Area of a disc of 12 to 13 um over that of the blur with which it is seen; see ``study sizes``."""
    row = TABLE_1[view]
    smallest_um = smallest_droplet_um(row.airy_diameter_um / 7.4, image_scale_px_per_mm(row.magnification, 7.4))
    assert 9 < smallest_um < 13.5


def test_a_lens_twice_as_open_shows_smaller_droplets_down_to_the_pixels() -> None:
    assert smallest_droplet_um(2, 60) < 0.65 * smallest_droplet_um(4, 60)
    assert smallest_droplet_um(0, 60) == pytest.approx(smallest_droplet_um(0, 120) * 2)


def test_scale_and_resolution_of_the_paper() -> None:
    assert image_scale_px_per_mm(0.444, 7.4) == pytest.approx(60)
    assert resolved_diameter_um(16, 0.43) == pytest.approx(65, abs=1)


def test_a_droplet_of_30_m_s_moves_30_um_in_a_pulse_and_192_um_between_two() -> None:
    assert travel_um(30, 1000) == 30
    assert travel_um(30, 6400) == 192
