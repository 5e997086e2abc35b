"""How accurate is a calibration? Against truth that only a simulation has, each figure beside its limit.

Cameras: see ``fitted_cameras``. Corners: see ``found_corners``. Cameras that have moved: see ``drifting_views``.
"""

from collections.abc import Iterator, Sequence
from operator import attrgetter

import numpy as np
from matplotlib.figure import Figure

from processing.figures.calibration_error_figures import ErrorPanel, calibration_errors_figure
from processing.studies.calibration_rows import CalibrationRow, CalibrationStudy, of_quantity
from processing.studies.drifting_views import drifting_views
from processing.studies.fitted_cameras import fitted_cameras
from processing.studies.found_corners import found_corners
from processing.studies.report import Statement, grouped

TITLES = {
    "true error": "cameras: error in space [px]",
    "corner error": "corners: error in the image [px]",
    "corner time": "corners: CPU time per image [s]",
    "disparity error": "watch: error of the disparity of single shots [px]",
    "drift error": "self-calibration: error left in the volume [px]",
}
LIMITED = {
    "true error": "rms",
    "corner error": "rms",
    "corner time": "time",
    "disparity error": "rms and alarms",
    "drift error": "largest error",
}
"""Which of its figures a quantity's limit is for."""
PAPER = {
    "true error": "< 0.05 px on the points of the fit; the volume is not asked",
    "corner error": "0.1 px",
    "corner time": "not given",
    "disparity error": "no watch",
    "drift error": "no self-calibration",
}


def calibration_study(study: CalibrationStudy | None = None) -> Iterator[CalibrationRow]:
    """Measure view by view; the same study gives the same errors (times differ)."""
    study = study or CalibrationStudy()
    yield from fitted_cameras(study)
    yield from found_corners(study)
    yield from drifting_views(study)


def calibration_statements(rows: Sequence[CalibrationRow]) -> list[Statement]:
    """The worst view of every case beside the limit and the paper's statement; then all fits beside the best ones."""
    statements = [
        Statement(
            f"{quantity}, {case} (limit {_number(chosen[0].limit, quantity)})",
            PAPER[quantity],
            _worst(chosen, quantity),
        )
        for quantity in TITLES
        for case, chosen in grouped(of_quantity(rows, quantity), attrgetter("case")).items()
    ]
    ratio = over_ideal(rows)
    if ratio is None:
        return statements
    topic = "rms of all fits, relative to that of the best unbiased fits"
    return [*statements, Statement(topic, "not given", f"{ratio:.2f}")]


def over_ideal(rows: Sequence[CalibrationRow]) -> float | None:
    """Root mean square of all true errors over that of the best unbiased fits; None without such rows."""
    pairs = [(row.value, row.ideal_rms) for row in rows if row.value is not None and row.ideal_rms is not None]
    if not pairs:
        return None
    found, ideal = np.square(pairs).sum(axis=0)
    return float(np.sqrt(found / ideal))


def all_kept(rows: Sequence[CalibrationRow]) -> bool:
    """Whether every limit is kept in every view."""
    return all(row.kept for row in rows)


def calibration_line(row: CalibrationRow) -> str:
    """One row for a person."""
    return f"{row.quantity}, {row.case}, {row.view}: {_worst([row], row.quantity)}"


def calibration_figure(rows: Sequence[CalibrationRow]) -> Figure:
    """Every case of every quantity, view by view, and the limits."""
    return calibration_errors_figure(
        [ErrorPanel(title, LIMITED[quantity], of_quantity(rows, quantity)) for quantity, title in TITLES.items()]
    )


def _worst(rows: Sequence[CalibrationRow], quantity: str) -> str:
    verdict = f"{LIMITED[quantity]} {'within' if all_kept(rows) else 'BEYOND'} the limit"
    values = _known(rows, "value")
    if len(values) < len(rows):
        return f"refused in {len(rows) - len(values)} of {len(rows)} views: {verdict}"
    text = _number(max(values), quantity)
    largest = _known(rows, "maximum")
    if largest:
        text = f"{text} rms, {max(largest):.2g} px at most"
    return f"{text}{_beside_the_ideal(rows)}: {verdict}"


def _beside_the_ideal(rows: Sequence[CalibrationRow]) -> str:
    """How much of it lies within the limit, and what the best fits leave; nothing where nobody asked."""
    if any(row.ideal_rms is None for row in rows):
        return ""
    rms_px, largest_px = (max(_known(rows, name)) for name in ("ideal_rms", "ideal_maximum"))
    within, fits_within = (100 * min(_known(rows, name)) for name in ("within", "ideal_fits_within"))
    limit = f"within {rows[0].limit:g} px"
    return (
        f", {within:.1f} % {limit} (best unbiased fits: {rms_px:.2g} px rms, {largest_px:.2g} px at most, "
        f"{fits_within:.0f} % of the fits {limit} everywhere)"
    )


def _known(rows: Sequence[CalibrationRow], name: str) -> list[float]:
    return [value for row in rows if (value := getattr(row, name)) is not None]


def _number(value: float, quantity: str) -> str:
    return f"{value:.2g} {'s' if quantity == 'corner time' else 'px'}"
