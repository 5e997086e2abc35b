"""Figures of sizes: what is drawn is what was measured."""

import json
from typing import Any

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import droplet_statistics
from processing.figures.size_figures import droplets_in_space_figure, sizes_figure


def shot(n: int, seed: int = 0, sized: bool = True) -> StoredDroplets:
    rng = np.random.default_rng(seed)
    columns: dict[str, Any] = {"frame": np.repeat(["a", "b"], [n - n // 2, n // 2])}
    columns |= {f"{axis}_mm": rng.uniform(-1, 1, n) for axis in "xyz"} | {"amplitude": rng.random(n) + 0.1}
    if sized:
        columns["diameter_um"] = 40 * np.exp(0.4 * rng.standard_normal(n))
    told = {frame: {"verdict": "good"} for frame in "ab"}
    return StoredDroplets(columns, {"settings": "{}", "exposures": json.dumps(told)})


def test_the_bars_hold_all_droplets_and_the_lines_are_the_statistics() -> None:
    shots = [shot(200, seed) for seed in range(3)]
    (axes,) = sizes_figure(shots, "spray").axes
    by_number, by_volume = (patch.get_data() for patch in axes.patches[:2])  # type: ignore[attr-defined]
    for stairs in (by_number, by_volume):
        assert np.sum(stairs.values * np.diff(stairs.edges)) == pytest.approx(1)
    statistics = droplet_statistics(shots)
    drawn = {str(line.get_label()).split()[0]: line.get_xdata()[0] for line in axes.lines}  # type: ignore[index]
    assert statistics.d10_um
    assert statistics.d32_um
    assert (drawn["D10"], drawn["D32"]) == (statistics.d10_um.value, statistics.d32_um.value)
    assert "600 droplets, exposures: 6, shots: 3" in axes.get_title()


def test_without_sizes_there_is_no_figure_and_the_reason_is_told() -> None:
    with pytest.raises(ValueError, match="no sizes to draw: bright particles have no diameter"):
        sizes_figure([shot(20, sized=False)])


@pytest.mark.parametrize("sized", [True, False])
def test_every_droplet_is_drawn_where_it_is_and_as_large_as_it_is(sized: bool) -> None:
    droplets = shot(31, sized=sized)
    (axes,) = droplets_in_space_figure(droplets).axes
    first, second = axes.collections
    assert (len(first.get_sizes()), len(second.get_sizes())) == (16, 15)  # type: ignore[attr-defined]
    sizes = droplets.columns["diameter_um" if sized else "amplitude"][:16]
    assert np.argmax(first.get_sizes()) == np.argmax(sizes)  # type: ignore[attr-defined]
    for drawn_mm, axis in zip(first._offsets3d, "xzy", strict=True):  # type: ignore[attr-defined]
        np.testing.assert_array_equal(drawn_mm, droplets.columns[f"{axis}_mm"][:16])


def test_an_empty_shot_is_an_empty_box() -> None:
    (axes,) = droplets_in_space_figure(shot(0)).axes
    assert not axes.collections
