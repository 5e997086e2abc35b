"""``tomoshadow self-calibrate``: a calibration is corrected by the droplets in the shots of a run."""

from argparse import Namespace
from typing import TYPE_CHECKING, Any

from server.cli.chosen_shots import selected_shots
from server.cli.options import Verbs, add_calibrated_run, add_out, add_shots, add_verb
from server.cli.output import Outcome, progress, table, tracked

if TYPE_CHECKING:
    from processing.calibration.droplets.self_calibration import SelfCalibration


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "self-calibrate", self_calibrate, "correct a calibration by the droplets in shots")
    add_calibrated_run(parser)
    add_shots(parser)
    add_out(parser, "calibration file to write")


def self_calibrate(options: Namespace) -> Outcome:
    """Correct, and write the new calibration."""
    from processing.calibration.calibration_file import load_calibration, save_calibration
    from processing.runs.overwriting import require_free
    from processing.runs.run_check import self_calibrate_run

    require_free(options.out, overwrite=options.overwrite)
    calibration = load_calibration(options.calibration)
    shots = selected_shots(options.run, options.shots)
    corrected = self_calibrate_run(options.run, shots, calibration, tracked)
    save_calibration(corrected.calibration, options.out, overwrite=options.overwrite)
    progress(corrected.calibration.notes[-1])
    named = {"calibration": str(options.out), "id": corrected.calibration.id, "parent": calibration.id}
    result = {**named, **_figures(corrected)}
    return Outcome(result, views_table(result))


def _figures(corrected: "SelfCalibration") -> dict[str, Any]:
    return {
        "moved": corrected.moved,
        "sub_volumes": corrected.sub_volumes,
        "droplets": corrected.droplets,
        "uncertainty_px": corrected.uncertainty_px,
        "views": {
            name: {
                "correction_px": corrected.corrections_px[name],
                "disparity_before_px": corrected.before_px[name],
                "disparity_after_px": corrected.after_px[name],
                "verdict": corrected.calibration.views[name].verdict,
            }
            for name in corrected.calibration.views
        },
    }


def views_table(result: dict[str, Any]) -> str:
    """A line per view, and the new calibration, for people."""
    keys = ("correction_px", "disparity_before_px", "disparity_after_px")
    rows = [[name, view["verdict"], *(f"{view[key]:.2f}" for key in keys)] for name, view in result["views"].items()]
    heads = ["view", "verdict", "correction [px]", "disparity before [px]", "after [px]"]
    return f"{table(heads, rows)}\n{result['id']}: {result['calibration']}, corrects {result['parent']}"
