"""A recipe instead of options, and the recipe of what options say."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from processing.runs.errors import PipelineError

if TYPE_CHECKING:
    from processing.calibration.calibration import Calibration
    from processing.reconstruction.settings import FrozenValue, ReconstructionSettings
    from processing.runs.droplets.measure_settings import MeasureSettings

Settings = TypeVar("Settings", bound="FrozenValue")
OnGrid = TypeVar("OnGrid", "ReconstructionSettings", "MeasureSettings")


def add_recipe(parser: ArgumentParser) -> None:
    """Let a command be told all settings by a file, or write them to one."""
    parser.add_argument("--recipe", type=Path, metavar="FILE", help="TOML of all settings, in place of their options")
    parser.add_argument("--write-recipe", type=Path, metavar="FILE", help="write the recipe of what is done here")


def settings_of(
    options: Namespace,
    command: tuple[str, int],
    kind: type[Settings],
    said_by: Sequence[str],
    by_options: Callable[[], Settings],
) -> Settings:
    """Settings of a recipe, or of options where there is none.

    Parameters
    ----------
    options : Namespace
        Of the command.
    command : str, int
        Its name, and the version of its method.
    kind : type
        Of its settings.
    said_by : sequence of str
        Options that a recipe takes the place of.
    by_options : callable
        What they say.

    Raises
    ------
    RecipeError
        The recipe cannot be followed.
    PipelineError
        Recipe and options were given.
    """
    from processing.runs.recipe import read_recipe

    if options.recipe is None:
        return by_options()
    if both := [f"--{name.replace('_', '-')}" for name in said_by if getattr(options, name) is not None]:
        raise PipelineError(f"{', '.join(both)}: {options.recipe} says all settings; change it there, or leave it out")
    return read_recipe(options.recipe, *command, kind)


def with_grid(settings: OnGrid, calibration: "Calibration") -> OnGrid:
    """Settings that name their grid; where they do not, the default of the calibration."""
    from processing.reconstruction.planning.calibrated_plan import default_grid
    from processing.reconstruction.settings import GridSettings

    if settings.grid is not None:
        return settings
    return settings.model_copy(update={"grid": GridSettings.of(default_grid(calibration))})


@contextmanager
def keeping_recipe(options: Namespace, command: tuple[str, int], settings: "FrozenValue") -> Iterator[None]:
    """Write the recipe of what was done, if that was asked for; what fails leaves none.

    Raises
    ------
    OutputExistsError
        There is such a file, and it may not be replaced.
    """
    from processing.runs.overwriting import require_free
    from processing.runs.recipe import write_recipe

    if options.write_recipe is not None:
        require_free(options.write_recipe, overwrite=options.overwrite)
    yield
    if options.write_recipe is not None:
        write_recipe(options.write_recipe, *command, settings)
