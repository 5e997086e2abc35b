# ruff: noqa: T201
"""Writes the table of lights in docs/droplets-found.md anew: what ten shots of each light gave.

    python -m tests.hunt.lights [--light NAME] [--page FILE]

``make hunt TABLE=lights`` does that. Prints a line per shot.
"""

import sys
import tempfile
from argparse import ArgumentParser
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tests.hunt.answer import asked
from tests.hunt.judge import in_box, mean_um
from tests.hunt.rig import SCALE_PX_PER_MM, eyes
from tests.hunt.world import Cloud, World, placed, taken
from tests.support.write_measured import replaced

PAGE = Path(__file__).parents[2] / "docs" / "droplets-found.md"
SHOTS = (*((count, noise) for count in (12, 40, 120) for noise in (0.005, 0.011, 0.015)), (300, 0.011))
"""Droplets, and standard deviation of the noise over the light."""
BLUR_PX = 0.75
OUTER = 1.2
"""Blur of the outer views over that of the inner ones: their lenses are stopped down more."""

Made = Callable[[World], World]


def _blurred(blur_px: float) -> Made:
    return lambda world: replace(world, blurs_px=(OUTER * blur_px, blur_px, blur_px, OUTER * blur_px))


def _lit(ratio: float) -> Made:
    return lambda world: replace(world, ratio=ratio)


def _smeared(way_px: float) -> Made:
    return lambda world: replace(world, smear_mm=(0.0, way_px / SCALE_PX_PER_MM, 0.0))


def _out_of_focus(disc_px: float) -> Made:
    return lambda world: replace(world, defocus_px=(disc_px,) * len(world.views))


LIGHTS: dict[str, tuple[Made, ...]] = {
    "Gaussian blur, 0.75 and 0.9 px": (_blurred(0.75), _blurred(0.9)),
    **{f"{ratio:g}": (_lit(ratio),) for ratio in (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4, 1.7)},
    "all directions": (_lit(8.0),),
    "droplets move by 1.7 and 2 px, Gaussian blur": (_smeared(1.7), _smeared(2.0)),
    "out of focus by discs of 4 and 5 px": (_out_of_focus(4.0), _out_of_focus(5.0)),
}
"""What is done to a shot; of two ways, every other shot has the second one."""


@dataclass(frozen=True)
class Seen:
    """What was told of a shot.

    Parameters
    ----------
    verdict : str
        Of the shot.
    error : float
        Of D32 over the true one; not a number where none was told.
    held : bool
        The interval of D32 holds the true one.
    """

    verdict: str
    error: float
    held: bool


def shot_of(name: str, number: int) -> World:
    """One of the ten shots of a light; droplets of 20 to 80 um, 8 bit."""
    count, noise = SHOTS[number]
    rng = np.random.default_rng([number, 3])
    diameters_um = np.clip(rng.lognormal(np.log(40), 0.35, count), 20, 80)
    still = np.zeros((count, 3))
    cloud = Cloud(placed(rng, diameters_um), still, diameters_um, still)
    blurs_px = (BLUR_PX,) * 4
    world = World("lights", number, (cloud,), eyes(4), blurs_px, noise=noise, bits=8, exposures=1)
    ways = LIGHTS[name]
    return ways[number % len(ways)](world)


def seen(world: World) -> Seen:
    """Ask the product."""
    with tempfile.TemporaryDirectory() as folder:
        answer = asked(Path(folder), world, taken(world))
    true_um = mean_um("d32_um", in_box(world.clouds[0]).diameters_um)
    told = answer.said["statistics"]["d32_um"] or dict.fromkeys(("value", "low", "high"), np.nan)
    held = bool(told["low"] <= true_um <= told["high"])
    return Seen(answer.said["shots"][0]["verdict"], told["value"] / true_um - 1, held)


def row(name: str, shots: Sequence[Seen]) -> str:
    """A line of the table."""
    verdicts = Counter(shot.verdict for shot in shots)
    said = ", ".join(f"{times} *{verdict}*" for verdict, times in verdicts.most_common())
    errors = np.array([100 * shot.error for shot in shots if np.isfinite(shot.error)])
    far = f"{errors.min():+.1f} to {errors.max():+.1f} %" if len(errors) else "none told"
    return f"| {name} | {said} | {far} | {sum(shot.held for shot in shots)} of {len(shots)} |"


def _rows(names: Sequence[str]) -> Iterator[str]:
    for name in names:
        shots = []
        for number in range(len(SHOTS)):
            shots.append(seen(shot_of(name, number)))
            print(name, SHOTS[number], shots[-1], flush=True)
        yield row(name, shots)


def main(arguments: list[str]) -> int:
    """Measure all lights, or one, and put the table into the page where it is whole."""
    parser = ArgumentParser(prog="python -m tests.hunt.lights")
    parser.add_argument("--light", choices=LIGHTS, help="only this one, which is printed alone")
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args(arguments)
    rows = list(_rows([options.light] if options.light else list(LIGHTS)))
    text = "\n".join(["| true light | verdict | D32, error | intervals that hold it |", "|---|---|---|---|", *rows, ""])
    print(text)
    if not options.light:
        options.page.write_text(replaced(options.page.read_text(), "lights", text))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
