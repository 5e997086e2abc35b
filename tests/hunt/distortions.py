"""All distortions by name, and what a line of ``not_checked`` must hold to have named one: see ``docs/how-sure.md``."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.hunt import bodily, imaged
from tests.hunt.world import Pictures, World

_GREYS, _HEIGHT = "proportion to light", "moves all droplets along y"
Bodily = Callable[[World, float, np.random.Generator], tuple[World, str]]
Imaged = Callable[[Pictures, float, np.random.Generator], tuple[Pictures, str]]


@dataclass(frozen=True)
class Distortion:
    """What goes wrong, and the words by which it may be excused.

    Parameters
    ----------
    world : callable, optional
        Changes what is before the lenses.
    pictures : callable, optional
        Changes what was recorded.
    named : str
        What nothing can tell, in words of ``not_checked``; empty: it must be doubted.
    """

    world: Bodily | None = None
    pictures: Imaged | None = None
    named: str = ""


def _of(function: Bodily, named: str = "") -> tuple[str, Distortion]:
    return function.__name__.replace("_", " "), Distortion(world=function, named=named)


def _on(function: Imaged, named: str = "") -> tuple[str, Distortion]:
    return function.__name__.replace("_", " "), Distortion(pictures=function, named=named)


DISTORTIONS = dict(
    (
        _of(bodily.view_shifted),
        _of(bodily.views_shifted, _HEIGHT),
        _of(bodily.view_scaled),
        _of(bodily.views_scaled, "same focus"),
        _of(bodily.view_rolled),
        _of(bodily.views_exchanged, "views exchanged"),
        _of(bodily.view_blurred),
        _of(bodily.view_out_of_focus),
        _of(bodily.views_out_of_focus),
        _of(bodily.smeared),
        _of(bodily.flattened),
        _of(bodily.droplets_outside),
        _of(bodily.second_motion, "have no partner"),
        _of(bodily.resting_droplets, "have no partner"),
        _of(bodily.fast_droplets, "have no partner"),
        _of(bodily.separation_wrong, "as the run states"),
        _of(bodily.light_stated_wrong),
        _of(bodily.lamps_unlike, "all views are in the same light"),
        _of(bodily.threads_among),
        _of(bodily.a_large_one),
        _on(imaged.gamma, _GREYS),
        _on(imaged.black_level),
        _on(imaged.veil),
        _on(imaged.brighter),
        _on(imaged.uneven),
        _on(imaged.glow),
        _on(imaged.dusty),
        _on(imaged.dusty_background),
        _on(imaged.hot_pixels),
        _on(imaged.saturated, _GREYS),
        _on(imaged.shots_saturated),
        _on(imaged.exposed_twice),
        _on(imaged.both_exposed_twice),
        _on(imaged.dead_view),
        _on(imaged.frozen_view),
        _on(imaged.half_hidden),
        _on(imaged.half_empty),
        _on(imaged.ghosted),
        _on(imaged.resampled),
        _on(imaged.shots_resampled),
        _on(imaged.compressed),
        _on(imaged.rows_shaken),
        _on(imaged.denoised),
        _on(imaged.sharpened),
        _on(imaged.banded),
        _on(imaged.coarse),
        _on(imaged.b_is_another),
        _on(imaged.b_is_a),
        _on(imaged.b_is_a_with_noise),
        _on(imaged.exchanged, "A is the earlier"),
        _on(imaged.exchanged_in_one),
        _on(imaged.lost_frame),
        _on(imaged.dimmer_b),
        _on(imaged.longer_b),
        _on(imaged.cropped, _HEIGHT),
        _on(imaged.mirrored, "mirrored"),
        _on(imaged.background_of_spray),
    )
)
