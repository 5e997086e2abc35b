"""Nozzle and axis are proposed where droplets fly away from one place, all around one direction; else not."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.spray.proposed_axis import NO_VELOCITIES, NOT_ALIKE, PARALLEL, SCATTERED, proposed_axis
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray

NOZZLE_MM, AXIS = np.array([0.4, -9.0, 0.2]), np.array([0.1, 1.0, -0.05])


def turned(vectors: FloatArray) -> FloatArray:
    """From a spray along y to one along the axis."""
    along = AXIS / np.linalg.norm(AXIS)
    across = np.cross(along, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    return np.asarray(vectors @ np.array([across, along, np.cross(across, along)]), np.float64)


def cone(
    seed: int, half_deg: float = 22.0, scatter: float = 0.04, shots: int = 6, part_deg: float = 360.0
) -> SpraySample:
    """Droplets 8 to 12 mm from the nozzle, most of them near the half angle, shots of different numbers."""
    rng = np.random.default_rng(seed)
    numbers = rng.poisson(200 * rng.gamma(10, 0.1, shots))
    count = int(numbers.sum())
    azimuth, angle = np.radians(rng.uniform(0, part_deg, count)), np.radians(rng.normal(half_deg, 3, count))
    ways = np.column_stack([np.sin(angle) * np.cos(azimuth), np.cos(angle), np.sin(angle) * np.sin(azimuth)])
    points_mm = NOZZLE_MM + turned(ways * rng.uniform(8, 12, (count, 1)))
    velocities_m_s = turned(20.0 * (ways + rng.normal(0, scatter, ways.shape)))
    velocities_m_s[::7] = np.nan
    return SpraySample(
        diameters_um=np.full(count, 40.0),
        points_mm=points_mm,
        velocities_m_s=velocities_m_s,
        shot=np.repeat(np.arange(shots), numbers),
        volumes_mm3=np.full(shots, 100.0),
    )


@pytest.mark.parametrize("half_deg", [12.0, 22.0, 35.0])
def test_the_nozzle_lies_within_its_interval_and_the_axis_is_that_of_the_cone(half_deg: float) -> None:
    held, off_mm = [], []
    for seed in range(10):
        found = proposed_axis(cone(seed, half_deg))
        assert found.nozzle_mm is not None
        assert found.axis is not None
        held += [one.low <= true <= one.high for one, true in zip(found.nozzle_mm, NOZZLE_MM, strict=True)]
        off_mm.append([one.value - true for one, true in zip(found.nozzle_mm, NOZZLE_MM, strict=True)])
        cosine = np.array(found.axis) @ AXIS / np.linalg.norm(AXIS)
        assert np.degrees(np.arccos(min(1.0, cosine))) < 2 * (found.axis_within_deg or 0)
    assert np.mean(held) >= 0.8
    assert np.abs(np.mean(off_mm, axis=0)).max() < 0.15


def test_scatter_does_not_draw_the_nozzle_towards_the_droplets() -> None:
    found = [proposed_axis(cone(seed, 15.0, scatter=0.08)).nozzle_mm for seed in range(10)]
    along_mm = [one[1].value - NOZZLE_MM[1] for one in found if one is not None]
    assert len(along_mm) == 10
    assert abs(np.mean(along_mm)) < 0.5  # without the correction 1.5 mm


@pytest.mark.parametrize("share", [0.03, 0.08])
def test_droplets_that_fly_anywhere_do_not_move_the_nozzle(share: float) -> None:
    """Of mist, or with wrong partners: before, 2 of a hundred moved it by a millimetre, beside an interval of 0.3."""
    held = []
    for seed in range(6):
        one, rng = cone(seed), np.random.default_rng(seed)
        wild = rng.random(len(one)) < share
        anywhere = rng.standard_normal(one.velocities_m_s.shape)
        found = proposed_axis(replace(one, velocities_m_s=np.where(wild[:, None], anywhere, one.velocities_m_s)))
        assert found.nozzle_mm is not None
        held += [one.low <= true <= one.high for one, true in zip(found.nozzle_mm, NOZZLE_MM, strict=True)]
    assert np.mean(held) >= 0.8


@pytest.mark.parametrize(("half_deg", "scatter"), [(12.0, 0.12), (22.0, 0.2)])
def test_velocities_that_scatter_as_much_as_directions_differ_tell_no_nozzle(half_deg: float, scatter: float) -> None:
    """Before: beside the true one by millimetres, with an interval that did not hold it."""
    for seed in range(5):
        found = proposed_axis(cone(seed, half_deg, scatter))
        assert found.nozzle_mm is None
        assert found.reason == SCATTERED


def test_a_proposal_is_said_as_one_with_the_options_that_state_it() -> None:
    words = proposed_axis(cone(4)).words
    assert words.startswith("proposed by how droplets fly: --nozzle=0.4")
    assert "degrees)" in words
    assert proposed_axis(cone(1, 35.0, part_deg=150.0)).words == f"none is proposed: {NOT_ALIKE}"


def test_half_a_cone_has_no_axis() -> None:
    found = proposed_axis(cone(1, 35.0, part_deg=150.0))
    assert (found.nozzle_mm, found.axis, found.reason) == (None, None, NOT_ALIKE)


def test_droplets_that_fly_side_by_side_tell_no_nozzle() -> None:
    found = proposed_axis(cone(2, 1.0, scatter=0.1, shots=3))
    assert found.nozzle_mm is None
    assert found.reason in (PARALLEL, NOT_ALIKE)


def test_without_velocities_nothing_is_proposed() -> None:
    sample = cone(3)
    still = SpraySample(
        sample.diameters_um, sample.points_mm, np.full(sample.points_mm.shape, np.nan), sample.shot, sample.volumes_mm3
    )
    assert proposed_axis(still).reason == NO_VELOCITIES
