"""What is wrong with the images of an exposure, told to people: its volume looks fine."""

from collections.abc import Mapping
from typing import Any

from processing.runs.exposure_faults import MOST_LOST
from server.cli.output import progress


def tell_faults(where: str, faults: Mapping[str, Any]) -> None:
    """Tell what ``exposure_faults`` has found; ``where`` names the exposure."""
    for name in faults.get("blind_views", ()):
        progress(f"{where}: {name} sees nothing; is the shot empty, or a lens covered, a light off?")
    for name in faults.get("dim_views", ()):
        progress(f"{where}: {name} uses less than 1/8 of its grey values; is light missing, or are its bits too many?")
    if (lost := faults.get("lost_share", 0.0)) > MOST_LOST:
        progress(f"{where}: {100 * lost:.2g} % of the intensity is in voxels too faint for uint8; take float16")
    for name, what in faults.get("odd_light", {}).items():
        progress(f"{where}: {name} {what}")
