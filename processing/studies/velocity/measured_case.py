"""Measuring the images of a simulated case, bright particles or shadows, as users do."""

from collections.abc import Sequence

from processing.analysis.droplets.bright_shot import BrightExposure, measure_bright
from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.shadows.light.light_search import Light
from processing.analysis.droplets.shadows.shadow_shot import ShadowExposure, measure_shadows
from processing.kernels import DEFAULT_THREADS
from processing.studies.droplets import DropletCase
from processing.studies.shadows.sizes import SizeCase
from processing.studies.simulated_droplets import Image

AnyCase = DropletCase | SizeCase


def plain_case(droplets: str, density_per_mm3: float) -> AnyCase:
    """Bright particles or opaque droplets of a density, all else as by default."""
    return DropletCase(density_per_mm3) if droplets == "bright" else SizeCase(density_per_mm3)


def measured_case(
    case: AnyCase,
    images: Sequence[Image],
    search: DropletSearch,
    threads: int = DEFAULT_THREADS,
    light: Light = "estimated",
) -> BrightExposure | ShadowExposure:
    """Droplets of one exposure of a case; ``light`` is that of shadows."""
    if isinstance(case, DropletCase):
        return measure_bright(images, search, threads=threads)
    return measure_shadows(images, search, light=light, threads=threads)
