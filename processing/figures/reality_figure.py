"""A figure of how probably droplets are told to be real, against how many are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from processing.analysis.droplets.ghost_share import GhostShare
from processing.analysis.estimates import Estimate

COLOURS = ("tab:blue", "tab:orange")


@dataclass(frozen=True)
class StatedShares:
    """Droplets that are told as about equally probably real.

    Parameters
    ----------
    stated : float
        Mean of what is told.
    ghosts : GhostShare
        Those among them.
    """

    stated: float
    ghosts: GhostShare


@dataclass(frozen=True)
class ToldShare:
    """Ghosts of a case.

    Parameters
    ----------
    told : Estimate
        Share of the droplets, as it is told.
    true : float
        As it is.
    """

    told: Estimate
    true: float


def reality_figure(shares: Mapping[str, Sequence[StatedShares]], ghosts: Mapping[str, Sequence[ToldShare]]) -> Figure:
    """True against stated shares with their intervals, and shares of ghosts of every case, by kind."""
    figure = Figure(figsize=(10, 4.8), layout="constrained")
    share_axes, ghost_axes = figure.subplots(1, 2)
    for colour, (kind, told) in zip(COLOURS, shares.items(), strict=False):
        _draw_shares(share_axes, kind, told, colour)
        _draw_ghosts(ghost_axes, kind, ghosts[kind], colour)
    share_axes.plot([0, 1], [0, 1], color="0.6", linewidth=1)
    share_axes.set(xlabel="told: probability of being real", ylabel="share that is real, 95 % by counting")
    _frame_ghosts(ghost_axes, ghosts)
    for axes in (share_axes, ghost_axes):
        axes.grid(alpha=0.25)
        axes.legend()
    return figure


def ghosts_figure(ghosts: Mapping[str, Sequence[ToldShare]]) -> Figure:
    """True against told shares of ghosts of every case, with their intervals, by kind."""
    figure = Figure(figsize=(5.4, 4.8), layout="constrained")
    axes = figure.subplots()
    for colour, (kind, told) in zip(COLOURS, ghosts.items(), strict=False):
        _draw_ghosts(axes, kind, told, colour)
    _frame_ghosts(axes, ghosts)
    axes.grid(alpha=0.25)
    axes.legend()
    return figure


def _frame_ghosts(axes: Axes, ghosts: Mapping[str, Sequence[ToldShare]]) -> None:
    most = 100 * max((max(one.told.high, one.true) for told in ghosts.values() for one in told), default=0.01)
    axes.plot([0, most], [0, most], color="0.6", linewidth=1)
    axes.set(xlabel="told: ghosts among the droplets of a case [%]", ylabel="ghosts [%]")
    axes.set(xscale="symlog", yscale="symlog")


def _draw_ghosts(axes: Axes, kind: str, told: Sequence[ToldShare], colour: str) -> None:
    for number, one in enumerate(told):
        axes.plot([100 * one.told.low, 100 * one.told.high], [100 * one.true] * 2, color=colour, linewidth=1.5)
        axes.plot(100 * one.told.value, 100 * one.true, "o", color=colour, label=None if number else kind)


def _draw_shares(axes: Axes, kind: str, told: Sequence[StatedShares], colour: str) -> None:
    for number, one in enumerate(sorted(told, key=lambda one: one.stated)):
        if one.ghosts.share is None or one.ghosts.interval is None:
            continue
        low, high = one.ghosts.interval
        axes.plot([one.stated] * 2, [1 - high, 1 - low], color=colour, linewidth=1.5)
        axes.plot(one.stated, 1 - one.ghosts.share, "o", color=colour, label=None if number else kind)
