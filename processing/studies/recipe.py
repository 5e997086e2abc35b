"""Recipe: a reconstruction method with its iterations, as studies compare them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from processing.figures.curve import MethodCurve, Values
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.smart import mart, smart
from processing.studies.report import grouped
from processing.studies.simulated_droplets import Image, Volume

PAPER_ITERATIONS = 20


@dataclass(frozen=True)
class Recipe:
    """A method and, where it iterates, how often.

    Parameters
    ----------
    method : ReconstructionMethod
        Any.
    iterations : int
        0 for line-of-sight methods, at least 1 for the others.
    """

    method: ReconstructionMethod
    iterations: int = 0

    def __post_init__(self) -> None:
        if self.method.iterative != (self.iterations > 0):
            raise ValueError(f"{self.method.value} does not take {self.iterations} iterations")

    @classmethod
    def named(cls, name: str, iterations: int = PAPER_ITERATIONS) -> "Recipe":
        """Recipe of a name like ``mlos``, ``smart-5`` or ``smart``, which takes ``iterations``.

        Raises
        ------
        ValueError
            There is no such method, or it does not take these iterations.
        """
        method_name, _, number = name.partition("-")
        known = [method.value for method in ReconstructionMethod]
        if method_name not in known or (number and not number.isdecimal()):
            raise ValueError(f"{name!r} is none of {', '.join(known)}, with -N for N iterations of smart or mart")
        method = ReconstructionMethod(method_name)
        return cls(method, int(number) if number else iterations * method.iterative)

    @property
    def name(self) -> str:
        """``mlos``, ``smart-5``; ``smart`` alone with the 20 iterations of the paper."""
        plain = self.iterations in (0, PAPER_ITERATIONS)
        return self.method.value if plain else f"{self.method.value}-{self.iterations}"

    @property
    def label(self) -> str:
        """What a legend says."""
        return f"{self.method.name}-{self.iterations}" if self.iterations else self.method.name

    def curve(self, x: Values, y: Values) -> MethodCurve:
        """The line of this recipe in a figure."""
        return MethodCurve(self.label, x, y, self.method.value, self.iterations)

    def continues(self, other: "Recipe | None") -> bool:
        """Whether the volume of the other one is on the way to this one's."""
        return other is not None and other.method is self.method and 0 < other.iterations < self.iterations


LINE_OF_SIGHT = tuple(Recipe.named(name) for name in ("mlos", "minlos", "gavlos"))
PAPER_RECIPES = (*LINE_OF_SIGHT, Recipe.named("smart"))
"""The methods of the paper."""
ALL_RECIPES = tuple(Recipe.named(n) for n in ("mlos", "minlos", "gavlos", "smart-5", "smart-10", "smart", "mart-5"))
"""And how SMART gets there, and MART, which corrects four times per iteration."""


def method_curves(rows: Sequence[Any], x: str, y: str) -> list[MethodCurve]:
    """One figure of a study's rows over another: a line for every method, in order of x."""
    return [
        Recipe.named(method).curve([getattr(row, x) for row in line], [getattr(row, y) for row in line])
        for method, line in grouped(sorted(rows, key=attrgetter(x)), attrgetter("method")).items()
    ]


def reconstruct_each(plan: Plan, images: Sequence[Image], recipes: Sequence[Recipe], out: Volume) -> Iterator[Recipe]:
    """Reconstruct by one recipe after the other; ``out`` holds the volume of the recipe just yielded.

    Iterations go on from the recipe before where that is on the way, so ``out`` must not be changed in between.
    """
    before: Recipe | None = None
    for recipe in recipes:
        start, done = (out, before.iterations) if before and recipe.continues(before) else (None, 0)
        if recipe.method is ReconstructionMethod.SMART:
            smart(plan, images, iterations=recipe.iterations - done, start=start, out=out)
        elif recipe.method is ReconstructionMethod.MART:
            mart(plan, images, iterations=recipe.iterations - done, start=start, out=out)
        else:
            line_of_sight(plan, images, recipe.method, out)
        before = recipe
        yield recipe
