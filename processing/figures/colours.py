"""Colours and lines that mean the same in every figure."""

from typing import Any

import numpy as np

VIEW_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#000000")
"""Of the views, in order; a rig has eight at most."""
FRAME_COLOURS = {"A": "#1f4e9c", "B": "#c0392b"}
"""Of the exposures of a double frame."""
METHOD_COLOURS = {"mlos": "#0072b2", "minlos": "#e69f00", "gavlos": "#009e73", "smart": "#cc79a7", "mart": "#56b4e9"}
"""Of the reconstruction methods."""
_STAGES = {5: (":", "^", 0.4), 10: ("--", "s", 0.0), 20: ("-", "o", -0.4)}
"""Line, marker, and by how much the colour of a method is lighter or darker after so many iterations."""


def method_style(method: str, iterations: int) -> dict[str, Any]:
    """Colour by method; line, marker and shade by iterations."""
    from matplotlib.colors import to_hex, to_rgb  # colours are also those of pages, which load no matplotlib

    line, marker, lighter = _STAGES.get(iterations, ("-", "o", 0.0))
    colour = np.array(to_rgb(METHOD_COLOURS[method]))
    shade = colour + lighter * (1 - colour if lighter > 0 else colour)
    return {"color": to_hex(tuple(shade)), "linestyle": line, "marker": marker, "markersize": 5}
