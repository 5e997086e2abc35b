"""What nothing checks in the measured droplets of a run, for people and programs."""

from pathlib import Path
from typing import TYPE_CHECKING

from server.cli.output import progress

if TYPE_CHECKING:
    from processing.analysis.droplets.droplet_file import StoredDroplets
    from processing.runs.droplets.measure_settings import MeasureSettings
    from processing.runs.droplets.measured_shot import ShotDroplets


def tell_unchecked(
    calibration_file: Path,
    run_dir: Path,
    settings: "MeasureSettings",
    shots: "list[ShotDroplets]",
    stored: "list[StoredDroplets]",
) -> list[dict[str, str]]:
    """Tell what nothing checks in the droplets of a run, and what to state so that it is; once for all its shots."""
    from daq.files.run_directory import RunReader
    from processing.analysis.even_rows import row_spacing_mm
    from processing.analysis.few_together import found_from
    from processing.analysis.near_or_far import CLOSE_PX, depth_known, depth_reversed, sights_of
    from processing.calibration.calibration_file import load_calibration
    from processing.calibration.sets.recorded_set import nominal_scales
    from processing.reconstruction.planning.calibrated_plan import default_grid
    from processing.runs.shots.turned_views import reversed_shows_px
    from processing.runs.unchecked_images import (
        below,
        even_rows,
        told_unchecked,
        unchecked_images,
        unknown_height,
        unlike_motions,
    )

    with RunReader(run_dir) as run:
        height = unknown_height(run.header)
        undirected = run.header.frames_per_shot == 2 and run.conditions.spray is None
        unscaled = not nominal_scales(run.header.configuration) and not settings.sizes
    velocities = (shot.velocity for shot in shots if shot.velocity)
    stated_ns = next((one.separation_ns for one in velocities if one.separation_source == "stated"), None)
    calibration = load_calibration(calibration_file)
    sights = sights_of(stored)
    grid = settings.grid.to_grid() if settings.grid else default_grid(calibration)
    unchecked = unchecked_images(
        settings.polarity,
        sizes_known=bool(settings.sizes),
        undirected=undirected,
        stated_ns=stated_ns,
        unscaled=unscaled,
        shallow=reversed_shows_px(calibration, grid) < CLOSE_PX,
        sparse=not depth_known(sights) and not depth_reversed(sights),
    )
    rows = even_rows(row_spacing_mm(stored)) if any(shot.velocity and shot.velocity.pairs for shot in shots) else []
    good = [shot.velocity for shot in shots if shot.velocity and shot.velocity.verdict == "good"]
    alone = [velocity.share_alone for velocity in good if velocity.share_alone is not None]
    faint = below(settings.polarity, [found_from(shot) for shot in stored])
    return told_unchecked([*unchecked, *faint, *rows, *unlike_motions(alone), height], progress)
