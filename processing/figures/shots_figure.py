"""A figure of how well droplets explain exposures, and how many of them are ghosts: exposure by exposure."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from processing.analysis.estimates import Estimate

VERDICT_COLOURS = {"good": "tab:blue", "empty": "0.6", "doubtful": "tab:orange", "refused": "tab:red"}


@dataclass(frozen=True)
class JudgedExposure:
    """What is told of an exposure.

    Parameters
    ----------
    verdict : str
        On it.
    residual_over_noise : float | None
        None where nothing was fitted.
    ghosts : Estimate | None
        Share of its droplets, if it is told.
    """

    verdict: str
    residual_over_noise: float | None
    ghosts: Estimate | None


def shots_figure(exposures: Sequence[JudgedExposure]) -> Figure:
    """Residual over noise of every exposure, by verdict, and its share of ghosts with its interval."""
    told = any(one.ghosts for one in exposures)
    figure = Figure(figsize=(9.5 if told else 5, 3.4), layout="constrained")
    ratio_axes, *ghost_axes = figure.subplots(1, 1 + told, squeeze=False).ravel()
    _draw_ratios(ratio_axes, exposures)
    for axes in ghost_axes:
        _draw_ghosts(axes, exposures)
    for axes in figure.axes:
        axes.set(xlabel="exposure, in the order of the table", xlim=(0.5, len(exposures) + 0.5))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.grid(alpha=0.25)
    figure.legend(loc="outside lower center", ncols=len(VERDICT_COLOURS), fontsize="small")
    return figure


def _draw_ghosts(axes: Axes, exposures: Sequence[JudgedExposure]) -> None:
    for place, one in enumerate(exposures, start=1):
        if one.ghosts:
            axes.plot([place] * 2, [100 * one.ghosts.low, 100 * one.ghosts.high], color="tab:blue", linewidth=1)
            axes.plot(place, 100 * one.ghosts.value, "o", color="tab:blue", markersize=4)
    axes.set(ylabel="ghosts among the droplets [%]", ylim=(0, None))


def _draw_ratios(axes: Axes, exposures: Sequence[JudgedExposure]) -> None:
    axes.axhline(1, color="0.6", linewidth=1)
    for verdict, colour in VERDICT_COLOURS.items():
        chosen = [
            (place, one.residual_over_noise)
            for place, one in enumerate(exposures, start=1)
            if one.verdict == verdict and one.residual_over_noise is not None
        ]
        if chosen:
            axes.plot(*zip(*chosen, strict=True), "o", color=colour, markersize=4, label=verdict)
    axes.set(ylabel="residual / noise")
