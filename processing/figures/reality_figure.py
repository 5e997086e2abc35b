"""A figure of how probably droplets are told to be real, against how many are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from processing.analysis.droplets.ghost_share import GhostShare

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


def reality_figure(
    shares: Mapping[str, Sequence[StatedShares]], ghosts: Mapping[str, Sequence[tuple[float, int]]]
) -> Figure:
    """True against stated shares with their intervals, and ghosts of every case against expected ones, by kind."""
    figure = Figure(figsize=(10, 4.8), layout="constrained")
    share_axes, ghost_axes = figure.subplots(1, 2)
    for colour, (kind, told) in zip(COLOURS, shares.items(), strict=False):
        _draw_shares(share_axes, kind, told, colour)
        expected, found = zip(*ghosts[kind], strict=True)
        ghost_axes.plot(expected, found, "o", color=colour, label=kind)
    share_axes.plot([0, 1], [0, 1], color="0.6", linewidth=1)
    share_axes.set(xlabel="told: probability of being real", ylabel="share that is real, 95 % by counting")
    most = max(max(pair) for pairs in ghosts.values() for pair in pairs) or 1
    ghost_axes.plot([0, most], [0, most], color="0.6", linewidth=1)
    ghost_axes.set(xlabel="ghosts expected, sum of 1 - p_real, a dot per case", ylabel="ghosts")
    ghost_axes.set(xscale="symlog", yscale="symlog")
    for axes in (share_axes, ghost_axes):
        axes.grid(alpha=0.25)
        axes.legend()
    return figure


def _draw_shares(axes: Axes, kind: str, told: Sequence[StatedShares], colour: str) -> None:
    for number, one in enumerate(sorted(told, key=lambda one: one.stated)):
        if one.ghosts.share is None or one.ghosts.interval is None:
            continue
        low, high = one.ghosts.interval
        axes.plot([one.stated] * 2, [1 - high, 1 - low], color=colour, linewidth=1.5)
        axes.plot(one.stated, 1 - one.ghosts.share, "o", color=colour, label=None if number else kind)
