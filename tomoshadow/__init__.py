"""From shadow images of a spray to a measured volume, on numpy arrays.

Images are (row, column) arrays with pixel centres at integers, points (N, 3) xyz in mm, volumes (z, y, x); views have
names. All functions are pure but those that load, save, read or write. Nothing is loaded before it is used.

Calibrate
    Checkerboard, Dots, find_target, calibrate, Calibration, load_calibration, save_calibration
Reconstruct
    intensity, common_grid, VoxelGrid, plan, mlos, minlos, gavlos, smart, mart
Measure
    measure, measure_velocities, measure_flat, track_droplets, mean_diameters, size_classes, droplet_statistics,
    velocity_statistics, spray_statistics, AskedFor, SprayAxis
Files
    read_run, shot_intensities, read_volume, write_volume, read_droplets, export_droplets, read_tracks,
    export_tracks
Judge and look
    quality_factor, slices_figure, isosurface_figure, shadowgraph_figure, sizes_figure, droplets_in_space_figure,
    velocities_figure
Try, and err
    example, BadInput
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from processing.analysis.droplets.droplet_file import read_droplets as read_droplets
    from processing.analysis.droplets.droplet_statistics import droplet_statistics as droplet_statistics
    from processing.analysis.droplets.size_statistics import mean_diameters as mean_diameters
    from processing.analysis.droplets.size_statistics import size_classes as size_classes
    from processing.analysis.exports.export import export_droplets as export_droplets
    from processing.analysis.exports.export import export_tracks as export_tracks
    from processing.analysis.flat.flat_droplets import measure_flat as measure_flat
    from processing.analysis.quality import quality_factor as quality_factor
    from processing.analysis.spray.spray_axis import SprayAxis as SprayAxis
    from processing.analysis.spray.spray_statistics import AskedFor as AskedFor
    from processing.analysis.spray.spray_statistics import spray_statistics as spray_statistics
    from processing.analysis.velocity.measured_velocities import measure_velocities as measure_velocities
    from processing.analysis.velocity.track_file import read_tracks as read_tracks
    from processing.analysis.velocity.track_table import track_droplets as track_droplets
    from processing.analysis.velocity.velocity_statistics import velocity_statistics as velocity_statistics
    from processing.calibration.calibrate import calibrate as calibrate
    from processing.calibration.calibration import Calibration as Calibration
    from processing.calibration.calibration_file import load_calibration as load_calibration
    from processing.calibration.calibration_file import save_calibration as save_calibration
    from processing.calibration.sets.array_set import find_target as find_target
    from processing.errors import BadInput as BadInput
    from processing.figures.size_figures import droplets_in_space_figure as droplets_in_space_figure
    from processing.figures.size_figures import sizes_figure as sizes_figure
    from processing.figures.velocity_figures import velocities_figure as velocities_figure
    from processing.figures.volume_figures import isosurface_figure as isosurface_figure
    from processing.figures.volume_figures import shadowgraph_figure as shadowgraph_figure
    from processing.figures.volume_figures import slices_figure as slices_figure
    from processing.reconstruction.volume_file import read_volume as read_volume
    from processing.reconstruction.volume_file import write_volume as write_volume
    from processing.synthetic.example import example as example
    from processing.volume import VoxelGrid as VoxelGrid
    from tomoshadow.droplets import measure as measure
    from tomoshadow.reconstruction import common_grid as common_grid
    from tomoshadow.reconstruction import gavlos as gavlos
    from tomoshadow.reconstruction import intensity as intensity
    from tomoshadow.reconstruction import mart as mart
    from tomoshadow.reconstruction import minlos as minlos
    from tomoshadow.reconstruction import mlos as mlos
    from tomoshadow.reconstruction import plan as plan
    from tomoshadow.reconstruction import smart as smart
    from tomoshadow.runs import read_run as read_run
    from tomoshadow.runs import shot_intensities as shot_intensities
    from tomoshadow.targets import Checkerboard as Checkerboard
    from tomoshadow.targets import Dots as Dots

_HOMES = {
    "processing.analysis.droplets.droplet_file": ("read_droplets",),
    "processing.analysis.droplets.droplet_statistics": ("droplet_statistics",),
    "processing.analysis.droplets.size_statistics": ("mean_diameters", "size_classes"),
    "processing.analysis.exports.export": ("export_droplets", "export_tracks"),
    "processing.analysis.flat.flat_droplets": ("measure_flat",),
    "processing.analysis.quality": ("quality_factor",),
    "processing.analysis.spray.spray_axis": ("SprayAxis",),
    "processing.analysis.spray.spray_statistics": ("AskedFor", "spray_statistics"),
    "processing.analysis.velocity.measured_velocities": ("measure_velocities",),
    "processing.analysis.velocity.track_file": ("read_tracks",),
    "processing.analysis.velocity.track_table": ("track_droplets",),
    "processing.analysis.velocity.velocity_statistics": ("velocity_statistics",),
    "processing.calibration.calibrate": ("calibrate",),
    "processing.calibration.calibration": ("Calibration",),
    "processing.calibration.calibration_file": ("load_calibration", "save_calibration"),
    "processing.calibration.sets.array_set": ("find_target",),
    "processing.errors": ("BadInput",),
    "processing.figures.size_figures": ("droplets_in_space_figure", "sizes_figure"),
    "processing.figures.velocity_figures": ("velocities_figure",),
    "processing.figures.volume_figures": ("isosurface_figure", "shadowgraph_figure", "slices_figure"),
    "processing.reconstruction.volume_file": ("read_volume", "write_volume"),
    "processing.synthetic.example": ("example",),
    "processing.volume": ("VoxelGrid",),
    "tomoshadow.droplets": ("measure",),
    "tomoshadow.reconstruction": ("common_grid", "gavlos", "intensity", "mart", "minlos", "mlos", "plan", "smart"),
    "tomoshadow.runs": ("read_run", "shot_intensities"),
    "tomoshadow.targets": ("Checkerboard", "Dots"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a name when it is first used."""
    if name not in _HOME_OF:
        raise AttributeError(f"tomoshadow has no {name!r}; it has {', '.join(sorted(_HOME_OF))}")
    value = globals()[name] = getattr(import_module(_HOME_OF[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(_HOME_OF)
