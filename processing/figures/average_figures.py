"""Figures of a mean of many shots: slices across the spray and their radial profiles (Fig. 6 of the paper)."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from processing.figures.colours import METHOD_COLOURS
from processing.figures.curve import MethodCurve
from processing.volume import VoxelGrid

Slice = NDArray[np.float64]


def mean_slices_figure(
    slices: Mapping[str, Slice],
    grid: VoxelGrid,
    profiles: Sequence[MethodCurve],
    gradients: Sequence[MethodCurve],
    title: str,
) -> Figure:
    """Mean slices in the order of Fig. 6, and their radial profiles.

    Parameters
    ----------
    slices : Mapping[str, (nz, nx) array]
        Mean intensity by label of the method; four at most.
    grid : VoxelGrid
        Grid of the slices.
    profiles, gradients : sequence of MethodCurve
        Profile of every method over the radius in mm, and its slope.
    title : str
        Title of the figure.
    """
    figure = Figure(figsize=(13.4, 7.6), layout="constrained")
    pictures, curves = figure.subfigures(1, 2, squeeze=False, width_ratios=(1, 1.1))[0]
    panels = pictures.subplots(2, 2, sharex=True, sharey=True)
    for axes, (label, slice_zx) in zip(panels.flat, slices.items(), strict=False):
        image = _draw_slice(axes, slice_zx, grid, label)
    for axes in panels[-1]:
        axes.set_xlabel("x [mm]")
    for axes in panels[:, 0]:
        axes.set_ylabel("z [mm]")
    pictures.colorbar(
        image, ax=panels, location="bottom", label="mean intensity, relative to the maximum [-]", shrink=0.8, aspect=40
    )
    upper, lower = curves.subplots(2, 1, sharex=True)
    _draw_profiles(upper, lower, profiles, gradients)
    figure.suptitle(title)
    return figure


def _draw_slice(axes: Axes, slice_zx: Slice, grid: VoxelGrid, title: str) -> AxesImage:
    half_mm = 0.5 * grid.pitch_mm
    extent = (
        grid.x_mm[0] - half_mm,
        grid.x_mm[-1] + half_mm,
        grid.z_mm[0] - half_mm,
        grid.z_mm[-1] + half_mm,
    )
    axes.set_title(title, fontsize="medium")
    return axes.imshow(slice_zx / slice_zx.max(), origin="lower", extent=extent, cmap="gray_r", vmin=0, vmax=1)


def _draw_profiles(upper: Axes, lower: Axes, profiles: Sequence[MethodCurve], gradients: Sequence[MethodCurve]) -> None:
    for axes, curves in ((upper, profiles), (lower, gradients)):
        for curve in curves:
            axes.plot(curve.x, curve.y, label=curve.label, color=METHOD_COLOURS[curve.method])
        axes.grid(alpha=0.25)
    upper.set(ylabel="radial profile, relative to the slice's mean [-]")
    upper.set_ylim(bottom=0)
    lower.set(xlabel="radius [mm]", ylabel="gradient of the profile [1/mm]")
    upper.legend(frameon=False)
