"""Figures of velocities: what is drawn is what was measured."""

import json
from typing import Any

import numpy as np
import pytest
from matplotlib.quiver import Quiver

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.figures.velocity_figures import PANELS, LinkedCase, linked_figure, velocities_figure
from processing.geometry import FloatArray


def shot(pairs: int, alone: int = 3, **told: Any) -> StoredDroplets:
    """Pairs, and droplets of A without a partner."""
    rng = np.random.default_rng(1)
    columns: dict[str, Any] = {"frame": np.repeat(["a", "b"], [pairs + alone, pairs])}
    rows = len(columns["frame"])
    columns |= {f"{axis}_mm": rng.uniform(-1, 1, rows) for axis in "xyz"}
    columns |= {f"{name}_m_s": rng.uniform(10, 30, rows) for name in "uvw"}
    for name in "uvw":
        columns[f"{name}_m_s"][pairs : pairs + alone] = np.nan
    columns["p_pair"] = np.where(np.isnan(columns["u_m_s"]), 0.1, np.linspace(0.6, 1, rows))
    return StoredDroplets(columns, {"run": "spray", "shot": 7, "velocity": json.dumps(told)})


def test_every_pair_is_an_arrow_where_its_droplet_is_in_each_of_three_panels() -> None:
    drawn = shot(20)

    def of_pairs(name: str) -> FloatArray:
        return np.asarray(drawn.columns[name][:20], np.float64)

    figure = velocities_figure(drawn)
    told = "spray, shot 7: 20 of 23 droplets of exposure A have a partner in B; grey dots have none"
    assert figure.get_suptitle() == told
    assert "grey" not in velocities_figure(shot(20, alone=0)).get_suptitle()
    for axes, (across, down, along, below) in zip(figure.axes, PANELS, strict=False):
        assert axes.get_xlabel() == f"{across} [mm]"
        (arrows,) = (one for one in axes.collections if isinstance(one, Quiver))
        np.testing.assert_array_equal(arrows.XY, np.column_stack([of_pairs(f"{one}_mm") for one in (across, down)]))
        drawn_m_s = [np.asarray(one, np.float64) for one in (arrows.U, arrows.V)]
        np.testing.assert_allclose(drawn_m_s, [of_pairs(f"{name}_m_s") for name in (along, below)])
        speeds = np.linalg.norm([of_pairs(f"{name}_m_s") for name in "uvw"], axis=0)
        np.testing.assert_allclose(np.asarray(arrows.get_array(), np.float64), speeds)
        assert axes.yaxis_inverted() == (down == "y"), "z points up, as in the other figures across the spray"
    assert figure.axes[-1].get_ylabel() == "speed [m/s]"


def test_of_a_flat_box_the_two_strips_are_one_above_the_other() -> None:
    flat = shot(20)
    flat.columns["y_mm"] = 0.1 * flat.columns["y_mm"]  # type: ignore[operator]
    panels = {axes.get_xlabel() + axes.get_ylabel(): axes for axes in velocities_figure(flat).axes}
    strips = [panels[f"{across} [mm]y [mm]"].get_subplotspec() for across in "xz"]
    assert [(one.rowspan.start, one.colspan.start) for one in strips if one] == [(0, 0), (1, 0)]


def test_pairs_that_are_not_sure_enough_are_left_out() -> None:
    drawn = shot(20)
    sure = int(np.count_nonzero(np.asarray(drawn.columns["p_pair"][:20], np.float64) >= 0.75))
    assert 0 < sure < 20
    assert f"{sure} of 23" in str(velocities_figure(drawn, least_p_pair=0.75).get_suptitle())


def test_without_velocities_there_is_no_figure_and_the_reason_is_told() -> None:
    with pytest.raises(ValueError, match="spray, shot 7: no motion in common"):
        velocities_figure(shot(0, reasons=["no motion in common"]))
    single = shot(5, reason="shots have one exposure")
    single.columns.pop("u_m_s")
    with pytest.raises(ValueError, match="spray, shot 7: shots have one exposure"):
        velocities_figure(single)


def test_a_study_is_drawn_with_its_limits() -> None:
    case = LinkedCase([0.99, 0.98], [1.0, 1.0], [0.03, 0.05], 0.95, 0.995, 0.06)
    figure = linked_figure({"28": case}, ("paired [%]", "right [%]", "rms [voxel]"), "shot")
    assert [axes.get_xlabel() for axes in figure.axes] == ["paired [%]", "right [%]", "rms [voxel]"]
    limits = [next(line.get_xdata()[0] for line in axes.lines if line.get_color() == "tab:red") for axes in figure.axes]  # type: ignore[index]
    assert limits == [95, 99.5, 0.06]
