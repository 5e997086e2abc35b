"""Curve: one line of a figure, as values."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = Sequence[float] | NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """One line of a figure.

    Parameters
    ----------
    label : str
        What the legend says.
    x, y : (N,) arrays
        Its points.
    """

    label: str
    x: Values
    y: Values


@dataclass(frozen=True)
class MethodCurve(Curve):
    """The line of a reconstruction method; ``colours.method_style`` says how it looks.

    Parameters
    ----------
    method : str
        Name of the method.
    iterations : int
        0 where it does not iterate.
    """

    method: str
    iterations: int
