"""Figures of velocities: droplets of a shot with theirs, and how well a study paired them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.stored_json import stored_json
from processing.figures.droplet_figures import draw_case
from processing.figures.spacing import rounded_down

PANELS = (("x", "y", "u", "v"), ("z", "y", "w", "v"), ("x", "z", "u", "w"))
"""Across, down, and the velocities along them."""
BESIDE, STACKED = "vuw", "vw;uw"
"""Panels side by side; of a flat box two are strips, one above the other."""
FLAT = 0.3
"""Height over width of a flat box."""
LENGTH_SHARE = 0.08
"""Of the widest side of what is drawn: the arrow of a median droplet."""
LEAST = 1e-9
"""Nothing drawn is slower, or narrower."""
NO_COLUMNS = "no velocities: its shot has one exposure, or is from before they were measured"


def velocities_figure(shot: StoredDroplets, least_p_pair: float = 0.5, title: str = "") -> Figure:
    """Droplets of exposure A in three projections, with arrows and colours of their velocities.

    Parameters
    ----------
    shot : StoredDroplets
        As ``read_droplets`` gives it.
    least_p_pair : float
        Droplets whose partner is less likely are grey dots.
    title : str
        Above the figure.

    Raises
    ------
    ValueError
        There are no velocities; the text says why.
    """
    if "u_m_s" not in shot.columns:
        raise ValueError(f"{shot.name}: {_reasons(shot) or NO_COLUMNS}")
    first = shot.columns["frame"] == "a"
    columns = {name: np.asarray(column)[first] for name, column in shot.columns.items()}
    speeds_m_s = np.linalg.norm([columns[f"{name}_m_s"].astype(np.float64) for name in "uvw"], axis=0)
    paired = np.isfinite(speeds_m_s) & (columns["p_pair"] >= least_p_pair)
    if not paired.any():
        raise ValueError(f"{shot.name}: {_reasons(shot) or f'no pair has a p_pair of {least_p_pair:g}'}")
    median_m_s = float(np.median(speeds_m_s[paired]))
    widest_mm = max(float(np.ptp(columns[f"{axis}_mm"])) for axis in "xyz")
    m_s_per_mm = max(median_m_s, LEAST) / (LENGTH_SHARE * max(widest_mm, LEAST))
    figure = Figure(figsize=(10.5, 4.2), layout="constrained")
    flat = float(np.ptp(columns["y_mm"])) < FLAT * widest_mm
    panels = figure.subplot_mosaic(STACKED if flat else BESIDE)
    for axes, panel in zip((panels[name] for name in BESIDE), PANELS, strict=True):
        arrows = _draw_panel(axes, columns, panel, paired, speeds_m_s, m_s_per_mm)
    key_m_s = rounded_down(max(median_m_s, LEAST))
    figure.axes[0].quiverkey(arrows, 0.04, 0.96, key_m_s, f"{key_m_s:g} m/s", labelpos="E", coordinates="figure")
    figure.colorbar(arrows, ax=figure.axes, label="speed [m/s]")
    told = f"{np.count_nonzero(paired)} of {len(paired)} droplets of exposure A have a partner in B"
    if not paired.all():
        told += "; grey dots have none"
    figure.suptitle(f"{title or shot.name}: {told}", fontsize="medium")
    return figure


def _draw_panel(
    axes: Axes,
    columns: Mapping[str, np.ndarray],
    panel: tuple[str, str, str, str],
    paired: np.ndarray,
    speeds_m_s: np.ndarray,
    m_s_per_mm: float,
) -> Quiver:
    across, down, along, below = panel
    places = [columns[f"{axis}_mm"] for axis in (across, down)]
    velocities_m_s = [columns[f"{name}_m_s"][paired] for name in (along, below)]
    axes.scatter(places[0][~paired], places[1][~paired], s=4, c="0.7", linewidths=0)
    arrows = axes.quiver(
        *(place[paired] for place in places),
        *velocities_m_s,
        speeds_m_s[paired],
        angles="xy",
        scale_units="xy",
        scale=m_s_per_mm,
        width=0.003,
        cmap="viridis",
    )
    axes.set(xlabel=f"{across} [mm]", ylabel=f"{down} [mm]", aspect="equal")
    axes.margins(0.08)
    if down == "y":
        axes.invert_yaxis()  # y points down, along the spray; z points up, as in other figures across it
    return arrows


def _reasons(shot: StoredDroplets) -> str:
    """Why a file has no velocities, as it says itself; empty where it does not."""
    told = stored_json(shot.provenance, "velocity")
    return str(told.get("reason") or "; ".join(told.get("reasons", ())))


@dataclass(frozen=True)
class LinkedCase:
    """Double exposures, or series, of a case.

    Parameters
    ----------
    share, right, rms_voxel : sequence of float
        Share of the droplets that are paired, or whole tracks; share of the pairs, or links, that are right; and error
        of a component of the motion. One per double exposure, or series.
    least_share, least_right, most_rms_voxel : float | None
        What is asked for.
    """

    share: Sequence[float]
    right: Sequence[float]
    rms_voxel: Sequence[float]
    least_share: float | None = None
    least_right: float | None = None
    most_rms_voxel: float | None = None


def linked_figure(cases: Mapping[str, LinkedCase], labels: tuple[str, str, str], each: str) -> Figure:
    """What is linked, how rightly, and errors of every double exposure or series, means, and limits as lines.

    Parameters
    ----------
    cases : mapping of str to LinkedCase
        By their names.
    labels : three str
        Of share, right and error.
    each : str
        What a dot is.
    """
    figure = Figure(figsize=(12, 1.6 + 0.5 * len(cases)), layout="constrained")
    share_axes, right_axes, rms_axes = figure.subplots(1, 3, sharey=True)
    for line, case in enumerate(cases.values()):
        draw_case(share_axes, line, case.share, case.least_share, 100)
        draw_case(right_axes, line, case.right, case.least_right, 100)
        draw_case(rms_axes, line, case.rms_voxel, case.most_rms_voxel)
    share_axes.set(yticks=range(len(cases)), yticklabels=list(cases))
    for axes, label in zip(figure.axes, labels, strict=True):
        axes.set_xlabel(label)
    share_axes.invert_yaxis()
    figure.suptitle(f"each {each} a dot, their mean a bar, what is asked for a red line", fontsize="small")
    return figure
