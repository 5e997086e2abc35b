"""What is wrong with the images of an exposure, told to people: its volume looks fine."""

from collections.abc import Mapping
from typing import Any

from server.cli.output import progress


def tell_faults(where: str, faults: Mapping[str, Any]) -> None:
    """Tell what ``exposure_faults`` has found; ``where`` names the exposure."""
    from processing.runs.exposure_faults import fault_lines

    for line in fault_lines(faults):
        progress(f"{where}: {line}")
