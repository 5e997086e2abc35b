"""A case: a world, how it is distorted, what was said of it, and the verdict. All of it follows from one seed."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.hunt.answer import asked
from tests.hunt.distortions import DISTORTIONS
from tests.hunt.judge import Verdict, judged
from tests.hunt.world import KINDS, World, drawn, taken

UNDISTORTED, ALONE = 0.25, 0.5
"""Shares of the cases; the rest has two distortions."""
NOTHING = "nothing"
"""What a distortion says where there is nothing to distort, as of B in a single exposure."""


@dataclass(frozen=True)
class Case:
    """One world and what became of it.

    Parameters
    ----------
    seed : int
        From which all of it follows.
    world : str
        Its kind.
    distortions : tuple of (name, amount)
        What was done, and how much, in words.
    verdict : Verdict
        What came of it; an "alarm" is a doubt without distortion.
    """

    seed: int
    world: str
    distortions: tuple[tuple[str, str], ...]
    verdict: Verdict

    @property
    def outcome(self) -> str:
        untrue = not self.distortions and self.verdict.outcome in ("doubted", "refused")
        return "alarm" if untrue else self.verdict.outcome


def drawn_case(seed: int, kind: str = "", names: Sequence[str] | None = None, amount: float | None = None) -> Case:
    """Draw the case of a seed, and ask the product; of this kind of world, with these distortions, where stated."""
    rng = np.random.default_rng([seed, 2])
    drawn_kind, drawn_names = str(rng.choice(list(KINDS))), _names(rng)
    amounts = rng.random(2) if amount is None else np.full(2, amount)
    chosen = drawn_names if names is None else tuple(names)
    world = drawn(kind or drawn_kind, seed)
    return case_of(world, dict(zip(chosen, map(float, amounts), strict=False)), rng)


def _names(rng: np.random.Generator) -> tuple[str, ...]:
    count = int(np.searchsorted([UNDISTORTED, UNDISTORTED + ALONE], rng.random()))
    return tuple(map(str, rng.choice(list(DISTORTIONS), count, replace=False)))


def case_of(world: World, amounts: dict[str, float], rng: np.random.Generator) -> Case:
    """Distort a world, bodies first, and ask the product."""
    said: list[tuple[str, str]] = []
    seen = world
    for name, amount in amounts.items():
        if change := DISTORTIONS[name].world:
            seen, told = change(seen, amount, rng)
            said.append((name, told))
    pictures = taken(seen)
    for name, amount in amounts.items():
        if alter := DISTORTIONS[name].pictures:
            pictures, told = alter(pictures, amount, rng)
            said.append((name, told))
    done = tuple((name, told) for name, told in said if told != NOTHING)
    with tempfile.TemporaryDirectory() as folder:
        answer = asked(Path(folder), seen, pictures)
    verdict = judged(seen, answer, [DISTORTIONS[name].named for name, _ in done])
    return Case(world.seed, world.kind, done, verdict)
