"""Options of ``tomoshadow study``: one function per study, defaults are the paper's."""

import argparse
import math
from collections.abc import Callable
from pathlib import Path

from processing.studies.recipe import PAPER_ITERATIONS, Recipe
from server.cli import study_commands

_EVERY_METHOD = "all, SMART after 5, 10 and 20 iterations, MART after 5"
MIN_SIGMA_VOXEL, MAX_SIGMA_VOXEL = 0.3, 10.0
AddVerb = Callable[..., argparse.ArgumentParser]
"""Adds a command: name, function, summary."""


def add_studies(add_verb: AddVerb) -> None:
    """Add the command of every study."""
    _add_density(add_verb)
    _add_ghosts(add_verb)
    _add_average(add_verb)
    _add_residuals(add_verb)
    _add_calibration(add_verb)
    _add_sensitivity(add_verb)


def _add_density(add_verb: AddVerb) -> None:
    summary = "reconstruction quality against droplet density, Fig. 7"
    parser = add_verb("density", study_commands.study_density, summary)
    _add_out(parser, "density")
    parser.add_argument("--sigma", type=width, action="append", help="blob width in voxel, repeatable; default 1.5")
    parser.add_argument("--iterations", type=count, help=f"of smart and mart without -N, {PAPER_ITERATIONS} by default")
    _add_methods(parser, _EVERY_METHOD)
    parser.add_argument("--all", action="store_true", help="sigma 0.75, 1.27, 1.5 and 2")


def _add_ghosts(add_verb: AddVerb) -> None:
    parser = add_verb("ghosts", study_commands.study_ghosts, "found and ghost droplets against droplet density")
    _add_out(parser, "ghosts")
    parser.add_argument("--sigma", type=width, default=1.0, help="blob width in voxel")
    _add_methods(parser, _EVERY_METHOD)


def _add_average(add_verb: AddVerb) -> None:
    parser = add_verb("average", study_commands.study_average, "mean of many shots of the hollow cone, Fig. 6")
    _add_out(parser, "average")
    parser.add_argument("--shots", type=count, default=266, help="realisations of the spray")
    parser.add_argument("--binning", type=int, choices=(1, 2, 4), default=2, help="of pixels; 1 is the paper's")
    parser.add_argument("--seed", type=seed, default=0, help="of spray, dust and noise")


def _add_residuals(add_verb: AddVerb) -> None:
    parser = add_verb("residuals", study_commands.study_residuals, "back-projection error plane by plane, Fig. 3")
    _add_out(parser, "residuals")
    parser.add_argument("--binning", type=int, choices=(1, 2), default=1, help="of pixels; 1 is the paper's")
    parser.add_argument("--seed", type=seed, default=0, help="of light, dust and noise")


def _add_calibration(add_verb: AddVerb) -> None:
    summary = "true errors of cameras, corners and self-calibration, beside their limits"
    parser = add_verb("calibration", study_commands.study_calibration, summary)
    _add_out(parser, "calibration")
    parser.add_argument(
        "--density",
        type=positive,
        action="append",
        help="droplets/mm3 for self-calibration, repeatable; default 3.5, 7",
    )
    parser.add_argument("--shots", type=count, default=4, help="shots of droplets for self-calibration")
    parser.add_argument("--seed", type=seed, default=0, help="of all noise")


def _add_sensitivity(add_verb: AddVerb) -> None:
    summary = "what calibration error, number and spread of views, and noise do to droplets found"
    parser = add_verb("sensitivity", study_commands.study_sensitivity, summary)
    _add_out(parser, "sensitivity")
    parser.add_argument("--density", type=positive, default=13.8, help="droplets per mm^3")
    parser.add_argument("--sigma", type=width, default=1.0, help="blob width in voxel")
    parser.add_argument("--repeats", type=count, default=3, help="realisations to average")
    _add_methods(parser, "mlos and smart-10")


def _add_out(parser: argparse.ArgumentParser, study: str) -> None:
    default = Path(f"study-{study}")
    parser.add_argument(
        "-o", "--out", type=Path, default=default, help=f"directory of CSV and figure; default {default}"
    )


def _add_methods(parser: argparse.ArgumentParser, default: str) -> None:
    parser.add_argument(
        "--method",
        type=recipe_name,
        action="append",
        metavar="NAME[-N]",
        help=f"mlos, minlos, gavlos, smart-N or mart-N with N iterations, repeatable; default {default}",
    )


def positive(text: str) -> float:
    """A finite number above 0."""
    if not 0 < (value := float(text)) < math.inf:
        raise argparse.ArgumentTypeError(f"{text} must be above 0, and finite")
    return value


def width(text: str) -> float:
    """Width of a droplet in voxel: one that a voxel can show, and that a window of the quality factor holds."""
    if not MIN_SIGMA_VOXEL <= (value := float(text)) <= MAX_SIGMA_VOXEL:
        raise argparse.ArgumentTypeError(f"{text} must be from {MIN_SIGMA_VOXEL:g} to {MAX_SIGMA_VOXEL:g} voxel")
    return value


def seed(text: str) -> int:
    """A whole number from 0 on."""
    if (value := int(text)) < 0:
        raise argparse.ArgumentTypeError(f"{text} must be 0 or more")
    return value


def count(text: str) -> int:
    """A whole number from 1 on."""
    if not (value := int(text)) > 0:
        raise argparse.ArgumentTypeError(f"{text} must be 1 or more")
    return value


def recipe_name(text: str) -> str:
    """The name of a recipe."""
    try:
        Recipe.named(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text
