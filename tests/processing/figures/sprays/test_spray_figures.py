"""Figures of a spray: what is drawn is what was computed."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.quiver import Quiver

from processing.analysis.spray.density_map import density_map
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample, spray_sample
from processing.analysis.spray.spray_statistics import AskedFor, SprayStatistics, spray_statistics
from processing.analysis.spray.velocity_field import field_across_axis, field_through_axis
from processing.figures.sprays.distribution_figure import distribution_figure
from processing.figures.sprays.field_figure import velocity_field_figure
from processing.figures.sprays.motion_figure import MOST_DOTS, motion_figure
from processing.figures.sprays.space_figures import density_figure, patternation_figure
from tests.support.sampled_sprays import cone_shots

ASKED = AskedFor(SprayAxis((0, 0, 0), (0, 1, 0)))


@pytest.fixture(scope="module")
def sample() -> SpraySample:
    return spray_sample(cone_shots(0, 4, 150))


@pytest.fixture(scope="module")
def told() -> SprayStatistics:
    return spray_statistics(cone_shots(0, 4, 150), ASKED)


def test_areas_over_the_logarithm_of_the_diameter_are_shares(told: SprayStatistics) -> None:
    densities, cumulative = distribution_figure(told).axes
    for patch in densities.patches[:3]:
        stairs = patch.get_data()  # type: ignore[attr-defined]
        assert np.sum(stairs.values * np.diff(np.log(stairs.edges))) == pytest.approx(1)
    names = {str(line.get_label()) for line in densities.lines}
    assert {"lognormal, by volume", "Rosin-Rammler, by volume"} <= names
    by_volume = next(line for line in cumulative.lines if line.get_label() == "by volume")
    assert np.asarray(by_volume.get_ydata())[-1] == pytest.approx(1)
    assert any(str(line.get_label()).startswith("D32 ") for line in cumulative.lines)


def test_dots_are_droplets_and_means_have_their_intervals(told: SprayStatistics, sample: SpraySample) -> None:
    assert told.motion
    speeds_m_s = np.linalg.norm(sample.velocities_m_s, axis=1)
    by_size, by_radius = motion_figure(told.motion, sample.diameters_um, speeds_m_s).axes
    assert len(by_size.lines[0].get_xydata()) == len(sample) <= MOST_DOTS  # type: ignore[arg-type]
    assert {text.get_text() for text in by_radius.get_legend().get_texts()} == {"axial", "radial"}  # type: ignore[union-attr]
    without = told.motion.model_copy(update={"by_radius": ()})
    assert motion_figure(without, sample.diameters_um, speeds_m_s).axes[1].get_title() == "no axis, no profile"


def test_cells_that_the_box_does_not_hold_are_left_out_of_the_disc(told: SprayStatistics) -> None:
    (one,) = told.patternations
    ring, *others = one.liquid_ppm
    hidden = one.model_copy(update={"liquid_ppm": ((None, *ring[1:]), *others)})
    disc, _bar, shares = patternation_figure(hidden).axes
    assert [label.get_text() for label in disc.get_xticklabels()][:3] == ["0° (x)", "45°", "90° (-z)"]
    (mesh,) = (artist for artist in disc.collections if hasattr(artist, "get_array"))
    drawn = mesh.get_array()
    assert drawn is not None
    assert np.count_nonzero(np.ma.getmaskarray(drawn)) == 16
    assert len(shares.patches) == one.sectors


def test_shots_scatter_beside_the_mean_and_of_one_shot_there_is_the_mean(sample: SpraySample) -> None:
    several = density_map(sample)
    single = density_map(replace(sample, shot=np.zeros_like(sample.shot), volumes_mm3=sample.volumes_mm3[:1]))
    assert several
    assert single
    mean, rms = (axes for axes in density_figure([several]).axes if axes.get_title())
    assert "by counting alone" in rms.get_title()
    assert mean.yaxis_inverted()
    assert [axes.get_title() for axes in density_figure([single, single]).axes if axes.get_title()] == ["mean", "mean"]


def test_what_could_not_be_measured_is_grey_and_its_share_is_drawn_beside_it(sample: SpraySample) -> None:
    shares = np.ones((4, 10, 24))
    shares[:, :, :6] = 0.3
    found = density_map(replace(sample, measured_shares={"xy": shares}))
    assert found
    mean, _rms, share = (axes for axes in density_figure([found]).axes if axes.get_title())
    assert share.get_title() == "82.5 % of the volume could be measured"
    (mesh,) = (artist for artist in mean.collections if isinstance(artist, QuadMesh))
    drawn = mesh.get_array()
    assert drawn is not None
    np.testing.assert_array_equal(np.ma.getmaskarray(drawn).reshape(10, 24), shares[0] < 0.5)


def test_arrows_are_drawn_where_a_mean_velocity_is_told(sample: SpraySample) -> None:
    assert ASKED.axis
    fields = field_through_axis(sample, ASKED.axis), field_across_axis(sample, ASKED.axis)
    through, across = (axes for axes in velocity_field_figure(*fields).axes if axes.get_title(loc="left"))
    assert through.yaxis_inverted()
    assert not across.yaxis_inverted()
    for axes, field in zip((through, across), fields, strict=True):
        assert field
        (arrows,) = (artist for artist in axes.collections if isinstance(artist, Quiver))
        assert np.count_nonzero(~np.asarray(arrows.Umask)) == np.isfinite(field.axial_m_s).sum()
    (mesh,) = (artist for artist in across.collections if isinstance(artist, QuadMesh))
    assert fields[1]
    assert mesh.norm.vmin == np.nanmin(fields[1].axial_m_s), "colours tell velocities apart"
    assert len(velocity_field_figure(None, fields[1]).axes) == 2
