"""Figures of droplets that were measured: how large they are, with intervals, and where the large ones are."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_statistics import DIAMETER, droplet_statistics
from processing.analysis.droplets.droplet_table import sizes_of
from processing.analysis.droplets.size_statistics import TOO_FEW, SizeClass, size_classes
from processing.analysis.estimates import Estimate
from processing.figures.colours import FRAME_COLOURS

MARKED = {"d10_um": "D10", "d32_um": "D32", "dv50_um": "Dv0.5"}
SMALLEST_PT2, LARGEST_PT2 = 4.0, 300.0
"""Areas of markers."""
MOST_TICKS = 8


def sizes_figure(shots: Iterable[StoredDroplets], title: str = "") -> Figure:
    """Distribution of diameters by number, with its intervals, and by volume, after ISO 9276-1; means with intervals.

    Parameters
    ----------
    shots : iterable of StoredDroplets
        A shot each, as ``read_droplets`` gives it.
    title : str
        Above the figure.

    Raises
    ------
    ValueError
        There are no diameters; the text says why.
    """
    shots = tuple(shots)
    statistics = droplet_statistics(shots)
    if statistics.reason not in (None, TOO_FEW):
        raise ValueError(f"no sizes to draw: {statistics.reason}")
    classes = size_classes(
        np.concatenate([shot.columns[DIAMETER] for shot in shots]), statistics.exposures / statistics.shots
    )
    figure = Figure(figsize=(9, 4.5), layout="constrained")
    axes = figure.add_subplot()
    _draw_classes(axes, classes)
    for number, (name, label) in enumerate(MARKED.items()):
        if (estimate := getattr(statistics, name)) is not None:
            _mark(axes, label, estimate, f"C{number + 1}")
    axes.set(xlabel="diameter [µm]", ylabel="density [1/µm]", xscale="log", ylim=(0, None))
    axes.set_title(
        f"{statistics.n} droplets, exposures: {statistics.exposures}, shots: {statistics.shots}; 95 %, "
        f"diameters by drawing {statistics.intervals_over}",
        fontsize="small",
    )
    axes.legend(fontsize="small")
    axes.grid(alpha=0.25)
    figure.suptitle(title)
    return figure


def droplets_in_space_figure(droplets: StoredDroplets, title: str = "") -> Figure:
    """Droplets of a shot where they are, each as large as it is relative to the others; exposures by colour.

    Parameters
    ----------
    droplets : StoredDroplets
        A shot; where there are no diameters, amplitudes take their place.
    title : str
        Above the figure.
    """
    columns = droplets.columns
    by = DIAMETER if DIAMETER in columns else "amplitude"
    sizes = sizes_of(columns)
    areas = SMALLEST_PT2 + (LARGEST_PT2 - SMALLEST_PT2) * (sizes / sizes.max(initial=1e-300)) ** 2
    figure = Figure(figsize=(8, 7), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    for frame, colour in zip("ab", FRAME_COLOURS.values(), strict=True):
        one = columns["frame"] == frame
        if one.any():
            x_mm, y_mm, z_mm = (columns[f"{axis}_mm"][one] for axis in "xyz")
            axes.scatter(
                x_mm, z_mm, y_mm, s=areas[one], c=colour, alpha=0.5, linewidths=0, label=f"exposure {frame.upper()}"
            )
    axes.set(xlabel="x [mm]", ylabel="z [mm]", zlabel="y [mm]")
    axes.invert_zaxis()
    extents_mm = _extents(columns["x_mm"], columns["z_mm"], columns["y_mm"])
    axes.set_box_aspect(extents_mm)
    for axis, extent_mm in zip("xyz", extents_mm, strict=True):
        axes.locator_params(axis=axis, nbins=max(2, round(MOST_TICKS * extent_mm / max(extents_mm))))
    if sizes.size:
        unit = " µm" if by == DIAMETER else ""
        axes.legend(title=f"{by.removesuffix('_um')} {sizes.min():.3g} to {sizes.max():.3g}{unit}", fontsize="small")
    figure.suptitle(title)
    return figure


def _draw_classes(axes: Axes, classes: Sequence[SizeClass]) -> None:
    edges_um = [*(one.low_um for one in classes), classes[-1].high_um]
    q0 = np.array([[one.q0_per_um.value, one.q0_per_um.low, one.q0_per_um.high] for one in classes]).T
    axes.stairs(q0[0], edges_um, fill=True, color="0.75", label="by number, q0")
    middles_um = np.sqrt(np.multiply(edges_um[:-1], edges_um[1:]))
    axes.errorbar(middles_um, q0[0], [q0[0] - q0[1], q0[2] - q0[0]], fmt="none", ecolor="0.4", linewidth=1)
    axes.stairs([one.q3_per_um for one in classes], edges_um, color="C0", linewidth=1.5, label="by volume, q3")


def _mark(axes: Axes, label: str, estimate: Estimate, colour: str) -> None:
    told = f"{label} {estimate.value:.3g} ({estimate.low:.3g} to {estimate.high:.3g}) µm"
    axes.axvline(estimate.value, color=colour, label=told)
    axes.axvspan(estimate.low, estimate.high, color=colour, alpha=0.2, linewidth=0)


def _extents(*columns: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (max(float(np.ptp(column)) if len(column) else 0.0, 1e-3) for column in columns)
    return x, y, z
