"""``tomoshadow size-calibration``: a recorded reticle of dots tells what diameters are found, and what they are."""

from argparse import ArgumentTypeError, Namespace
from typing import Any

from server.cli.chosen_shots import selected_shots
from server.cli.light_option import add_light
from server.cli.options import (
    Verbs,
    add_calibrated_run,
    add_out,
    add_shots,
    add_verb,
    positive,
)
from server.cli.output import Outcome, table, tracked


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "size-calibration", size_calibration, "measure a reticle of dots of known diameters")
    add_calibrated_run(parser)
    add_shots(parser)
    parser.add_argument(
        "--diameters",
        type=_diameters,
        required=True,
        metavar="D,D,...",
        help="of its dots in um, all that are seen three times or more",
    )
    parser.add_argument(
        "--tolerance-um", type=positive, metavar="UM", help="standard deviation of these diameters; default 1"
    )
    add_light(parser)
    add_out(parser, "file of sizes to write, JSON")


def _diameters(text: str) -> tuple[float, ...]:
    diameters_um = tuple(positive(part) for part in text.split(","))
    if sorted(set(diameters_um)) != list(diameters_um):
        raise ArgumentTypeError(f"{text}: state each diameter once, from the smallest to the largest")
    return diameters_um


def size_calibration(options: Namespace) -> Outcome:
    """Measure the dots, and write what they say."""
    from processing.calibration.calibration_file import load_calibration
    from processing.runs.overwriting import require_free
    from processing.runs.reticle.size_calibration import (
        TOLERANCE_UM,
        calibrate_sizes,
        save_size_calibration,
    )

    require_free(options.out, overwrite=options.overwrite)
    found = calibrate_sizes(
        options.run,
        selected_shots(options.run, options.shots),
        load_calibration(options.calibration),
        options.diameters,
        light=options.light or "estimated",
        tolerance_um=options.tolerance_um or TOLERANCE_UM,
        follow=tracked,
    )
    save_size_calibration(found, options.out)
    result = {**found.model_dump(mode="json", by_alias=True), "file": str(options.out), "passed": found.passed}
    if found.passed:
        return Outcome(result, f"{_sizes_table(result)}; measure --sizes {options.out}")
    result["reason"] = found.reasons[0]
    return Outcome(result, f"{_sizes_table(result)}\n{options.out} failed: {result['reason']}")


def _sizes_table(result: dict[str, Any]) -> str:
    """A line per diameter, for people."""
    views = list(result["blurs_px"])
    rows = [
        [
            f"{size['true_um']:g}",
            f"{size['found_um']:.2f}",
            f"{size['sd_um']:.2f}",
            f"{size['found_um'] - size['true_um']:+.2f}",
            str(size["dots"]),
            *(f"{size['views_um'][view]:.2f}" for view in views),
        ]
        for size in result["sizes"]
    ]
    heads = ["true [um]", "found [um]", "sd", "difference", "dots", *views]
    light = result["light"] if isinstance(result["light"], str) else f"{result['light']:g} apertures of the lens"
    return f"{table(heads, rows)}\nlight: {light}"
