"""Masked arrays of numpy, whose masks numerics do not see."""

import numpy as np


def require_unmasked(name: str, array: object) -> None:
    """Refuse an array of which something is masked, as it would count as it is.

    Raises
    ------
    ValueError
        The text names it.
    """
    if np.ma.is_masked(array):
        raise ValueError(f"{name}: has masked values, which would count as they are: fill them with what is known")
