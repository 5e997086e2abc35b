"""Droplets of images, by the names of their views."""

from collections.abc import Mapping
from typing import get_args

from processing.analysis.droplets.bright_shot import BrightExposure, measure_bright
from processing.analysis.droplets.droplet_search import MARGIN_VOXEL, plan_droplets
from processing.analysis.droplets.shadows.light.light_search import Light, NamedLight
from processing.analysis.droplets.shadows.shadow_shot import ShadowExposure, measure_shadows
from processing.calibration.calibration import Calibration
from processing.coherent_light import MOST_RATIO
from processing.count import require_count
from processing.grey_image import require_image
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity, Polarity
from processing.reconstruction.planning.calibrated_plan import telling_where
from processing.runs.shots.stated_lengths import own_doubt
from processing.volume import VoxelGrid


def measure(
    calibration: Calibration,
    images: Mapping[str, Intensity],
    grid: VoxelGrid,
    *,
    polarity: Polarity = "bright",
    light: Light = "estimated",
    twins: int = 0,
    seed: int = 0,
    margin_voxel: int = MARGIN_VOXEL,
    threads: int = DEFAULT_THREADS,
) -> BrightExposure | ShadowExposure:
    """Measure the droplets of one exposure: where they are, how bright, how sure, and whether to believe it.

    Parameters
    ----------
    calibration : Calibration
        Of the views.
    images : mapping of view to (rows, columns) float32 array
        Bright particles on black, less the dark image, of any unit; or, of shadows, the light over that of the
        background, ``(image - dark) / (background - dark)``. Not clipped, or noise cannot be judged.
    grid : VoxelGrid
        Where droplets are measured, about one voxel per pixel, see ``common_grid``.
    polarity : {"bright", "shadow"}
        Only shadows tell how large droplets are.
    light : float or {"estimated", "incoherent", "gaussian"}
        Of shadows alone: numerical aperture of the light over that of the lens, above 0 to 8; light from all
        directions; or whatever is behind a Gaussian blur. ``diameters_um`` are corrected for it, ``diameters_raw_um``
        are not.
    twins : int
        Simulated twins of the exposure in which ghosts are counted, a witness; each costs as much as the exposure
        itself. Where views are not four, and apart, there is one at least.
    seed : int
        Of the twins.
    margin_voxel : int
        So far around the grid droplets are looked for: it must hold all that all views see.
    threads : int
        The result does not depend on it.

    Returns
    -------
    MeasuredExposure
        ``droplets`` with ``points_mm``, ``covariance_mm2``, ``amplitudes`` or ``diameters_um``, and ``columns()``;
        ``verdict``, ``reasons``, ``residual_over_noise``, ``views`` as they were found to be, ``ghost_share``
        with its interval, or why it is not told, and ``hidden``: what could not be measured.

    Raises
    ------
    CalibrationError
        A view is not in the calibration or was refused, or the calibration has no common world.
    ReconstructionError
        Too few or too many views, or voxels much wider or narrower than pixels.
    ValueError
        Images that do not fit the calibration, a pixel that is not finite, or options that do not exist or mean nothing
        for the polarity.
    """
    _require_options(polarity, light)
    for name, count in (("twins", twins), ("seed", seed), ("margin_voxel", margin_voxel)):
        require_count(name, count)
    require_count("threads", threads, 1)
    for name, image in images.items():
        require_image(name, image)
    names = tuple(images)
    calibration.require_usable(names)
    mappings = [calibration.views[name].mapping for name in names]
    with telling_where(calibration, grid):
        search = plan_droplets(mappings, grid, names, margin_voxel=margin_voxel)
    seen, doubts = list(images.values()), tuple(filter(None, [own_doubt(calibration, names)]))
    if polarity == "shadow":
        shadows = measure_shadows(seen, search, light=light, twins=twins, seed=seed, threads=threads)
        return shadows.doubted(doubts, before=True)
    bright = measure_bright(seen, search, twins=twins, seed=seed, threads=threads)
    return bright.doubted(doubts, before=True)


def _require_options(polarity: Polarity, light: Light) -> None:
    if polarity not in get_args(Polarity):
        raise ValueError(f"polarity {polarity!r}: {' or '.join(get_args(Polarity))}, please")
    named = get_args(NamedLight)
    if light not in named and not (isinstance(light, int | float) and 0 < light <= MOST_RATIO):
        raise ValueError(f"light {light!r}: {', '.join(named)}, or a number above 0 up to {MOST_RATIO:g}, please")
    if polarity == "bright" and light != "estimated":
        raise ValueError(f"light {light!r} is for shadows: bright particles have no diameter that it could correct")
