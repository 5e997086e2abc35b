"""Figures of volumes and of the images they come from: slices and projections, iso-surfaces (Fig. 4), shadowgraphs."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource, PowerNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray
from skimage.measure import marching_cubes

from processing.figures.colours import FRAME_COLOURS
from processing.figures.spacing import Room, spaced_panels
from processing.figures.volume_look import GrowingLook, VolumeLook
from processing.reconstruction.slab_volume import slabs_of
from processing.volume import VoxelGrid

Volume = NDArray[np.float32]


def slices_figure(volume: Volume, grid: VoxelGrid, title: str = "") -> Figure:
    """Slices through the fullest planes (top) and maximum projections (bottom) of a volume along its three axes.

    Colours follow the square root of the intensity, so that single droplets show beside dense liquid.

    Parameters
    ----------
    volume : (z, y, x) array
        Intensities.
    grid : VoxelGrid
        Where its voxels lie.
    title : str
        Title of the figure.

    Returns
    -------
    Figure
        Of matplotlib: ``figure.savefig("slices.png")``.
    """
    look = GrowingLook(grid.shape)
    for _ in look.watching(slabs_of(volume)):
        pass
    return look_figure(look.look(lambda axis, index: np.take(volume, index, axis)), grid, title)


def look_figure(look: VolumeLook, grid: VoxelGrid, title: str = "") -> Figure:
    """The same of a volume that has been looked at, and need not be there any more."""
    figure = Figure(figsize=(11, 5.8))
    room = Room(left=0.8, right=1.45, bottom=0.5, top=_top_in(title), across=0.85, down=0.75)
    panels = spaced_panels(figure, 2, 3, room)
    scale = PowerNorm(0.5, vmin=0, vmax=float(np.quantile(look.projections[0], 0.999)) or 1.0)
    for column, axis in enumerate((0, 1, 2)):
        depth_mm = (grid.z_mm, grid.y_mm, grid.x_mm)[axis][look.fullest[axis]]
        label = f"{'zyx'[axis]} = {depth_mm:.2f} mm"
        picture = _show(panels[0, column], look.slices[axis], grid, axis, scale)
        panels[0, column].set_title(f"slice at {label}", fontsize="medium")
        _show(panels[1, column], look.projections[axis], grid, axis, scale)
        panels[1, column].set_title(f"maximum along {'zyx'[axis]}", fontsize="medium")
    figure.colorbar(picture, cax=figure.add_axes((0.905, 0.2, 0.016, 0.6)), label="reconstructed intensity [-]")
    if title:
        figure.suptitle(title)
    return figure


def isosurface_figure(frames: Mapping[str, Volume], grid: VoxelGrid, level: float, title: str = "") -> Figure:
    """Iso-surfaces of exposures A (blue) and B (red) in one volume (Fig. 4 of the paper).

    Parameters
    ----------
    frames : Mapping[str, Volume]
        Volumes (z, y, x) of the exposures "a" and "b", or of one of them.
    grid : VoxelGrid
        Grid of all of them; a few million voxels at most.
    level : float
        Intensity of the surface.
    title : str
        Title of the figure.
    """
    figure = Figure(figsize=(6.4, 6.0), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    for name, volume in frames.items():
        mesh = _surface(volume, grid, level)
        if mesh is not None:
            vertices_mm, faces = mesh
            axes.add_collection3d(_shaded(vertices_mm[faces][..., [0, 2, 1]], FRAME_COLOURS[name.upper()]))
        axes.plot([], [], [], color=FRAME_COLOURS[name.upper()], linewidth=6, label=f"exposure {name}")
    axes.set(xlim=grid.x_mm[[0, -1]], ylim=grid.z_mm[[0, -1]], zlim=grid.y_mm[[-1, 0]])
    axes.set(xlabel="x [mm]", ylabel="z [mm]", zlabel="y [mm]")
    axes.set_box_aspect([float(np.ptp(extent_mm)) or 1.0 for extent_mm in (grid.x_mm, grid.z_mm, grid.y_mm)], zoom=0.85)
    axes.zaxis.labelpad = 8
    axes.legend(frameon=False, loc="upper left")
    if title:
        figure.suptitle(title)
    return figure


def shadowgraph_figure(images: Mapping[str, NDArray[np.generic]], title: str = "") -> Figure:
    """One exposure of every view, side by side.

    Parameters
    ----------
    images : mapping of view to (rows, columns) array
        Grey values or intensities.
    title : str
        Title of the figure.
    """
    figure = Figure(figsize=(2.6 * len(images), 2.4))
    room = Room(left=0.65, right=0.1, bottom=0.45, top=_top_in(title), across=0.45)
    (panels,) = spaced_panels(figure, 1, len(images), room)
    for axes, (name, image) in zip(panels, images.items(), strict=True):
        axes.imshow(image, cmap="gray", vmin=0)
        axes.set(title=name, xlabel="column [px]", ylabel="row [px]" if axes is panels[0] else "")
        axes.tick_params(labelsize="small")
    if title:
        figure.suptitle(title)
    return figure


def _top_in(title: str) -> float:
    """Room in inches for the titles of panels, and of the figure if it has one."""
    return 0.55 if title else 0.3


def _show(axes: Axes, image: NDArray[np.float32], grid: VoxelGrid, axis: int, scale: PowerNorm) -> AxesImage:
    names = [name for name in "zyx" if name != "zyx"[axis]]
    across_mm, down_mm = ({"x": grid.x_mm, "y": grid.y_mm, "z": grid.z_mm}[name] for name in reversed(names))
    half_mm = grid.pitch_mm / 2
    extent = (across_mm[0] - half_mm, across_mm[-1] + half_mm, down_mm[-1] + half_mm, down_mm[0] - half_mm)
    axes.set(xlabel=f"{names[1]} [mm]", ylabel=f"{names[0]} [mm]")
    picture = axes.imshow(image, cmap="magma", norm=scale, extent=extent, interpolation="antialiased")
    if names[0] == "z":
        axes.invert_yaxis()  # y points down, along the spray; z points up, as in other figures across it
    axes.ticklabel_format(useOffset=False)
    return picture


def _surface(volume: Volume, grid: VoxelGrid, level: float) -> tuple[NDArray[np.float64], NDArray[np.intp]] | None:
    if not volume.min() < level < volume.max():
        return None
    vertices, faces, _, _ = marching_cubes(volume, level)  # type: ignore[no-untyped-call]
    return grid.to_mm(vertices), faces


def _shaded(triangles: NDArray[np.float64], colour: str) -> Poly3DCollection:
    return Poly3DCollection(
        triangles, facecolors=colour, linewidths=0, shade=True, lightsource=LightSource(azdeg=225, altdeg=45)
    )
