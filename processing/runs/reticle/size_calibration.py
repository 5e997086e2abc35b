"""A recorded reticle + a calibration -> what diameters are found and what they are, as a JSON file."""

import json
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationError

from daq.files.run_directory import RunReader
from processing.analysis.droplets.shadows.light.light_search import Light
from processing.analysis.droplets.shadows.light.seen_light import light_doubts
from processing.analysis.droplets.size_correction import SizeRow
from processing.analysis.reticle.reticle_sizes import ReticleSizes, measure_reticle
from processing.analysis.reticle.size_groups import ReticleError
from processing.analysis.reticle.stillness import require_still
from processing.calibration.calibration import Calibration
from processing.calibration.droplets.droplet_matching import Box
from processing.geometry import FloatArray
from processing.preprocessing import Intensity
from processing.reconstruction.planning.calibrated_plan import default_grid
from processing.reconstruction.settings import FrozenValue
from processing.runs.droplets.measure_settings import MeasureSettings, require_measurable
from processing.runs.measured_images import require_backgrounds, shadow_images
from processing.runs.overwriting import replacing
from processing.runs.shots.shot_images import frame_names, require_match
from processing.runs.workbench import read_references

SCHEMA: Literal["tomoshadow/sizes"] = "tomoshadow/sizes"
TOLERANCE_UM = 1.0
"""Of a dot, where its maker states none."""
MOST_LEFT = 0.03
"""Root mean square around the dots, of the light: more, and they are no opaque dots in this focus."""


class DotSizes(FrozenValue):
    """Dots of one diameter: true and found, with the standard deviation of what was found; by view."""

    true_um: float
    found_um: float
    sd_um: Annotated[float, Field(ge=0)]
    dots: int
    views_um: dict[str, float]


class SizeCalibration(FrozenValue):
    """What a reticle says of the diameters that are measured."""

    schema_name: Annotated[Literal["tomoshadow/sizes"], Field(alias="schema")] = SCHEMA
    schema_version: Literal[1] = 1
    run: str
    calibration: str
    tomoshadow: str
    light: Annotated[Light, Field(description="in which the diameters were found: condenser ratio, or gaussian")]
    light_share: float
    blurs_px: dict[str, float]
    residual: float
    middle_mm: tuple[float, float, float]
    normal: tuple[float, float, float]
    tolerance_um: Annotated[float, Field(gt=0)]
    sizes: Annotated[tuple[DotSizes, ...], Field(min_length=1)]

    @property
    def reasons(self) -> tuple[str, ...]:
        """What speaks against it."""
        if self.residual <= MOST_LEFT:
            return light_doubts(self.light_share, sum(size.dots for size in self.sizes))
        return (
            f"{100 * self.residual:.1f} % of the light is left around the dots, limit {100 * MOST_LEFT:g} %: is the "
            "reticle in focus, did it move, and are its dots round and opaque?",
        )

    @property
    def passed(self) -> bool:
        """Whether dots look as opaque dots do, in a light that they tell."""
        return not self.reasons

    @property
    def rows(self) -> tuple[SizeRow, ...]:
        """Found, true and standard deviation, as the measurement takes them."""
        return tuple(
            (size.found_um, size.true_um, float(np.hypot(size.sd_um, self.tolerance_um))) for size in self.sizes
        )


def calibrate_sizes(
    run_dir: Path,
    shots: Sequence[int],
    calibration: Calibration,
    diameters_um: Sequence[float],
    *,
    light: Light = "estimated",
    tolerance_um: float = TOLERANCE_UM,
    follow: Callable[[Sequence[int]], Iterable[int]] = iter,
) -> SizeCalibration:
    """Measure the dots of a recorded reticle.

    Parameters
    ----------
    run_dir : Path
        Its run: shadows, with a background. The reticle must not move.
    shots : sequence of int
        Whose exposures are averaged.
    calibration : Calibration
        Of the views.
    diameters_um : sequence of float
        Of its dots, increasing: all that are seen three times or more.
    light : float | "estimated" | "incoherent" | "gaussian"
        Numerical aperture of the light over that of the lens.
    tolerance_um : float
        Standard deviation of the diameters that the maker states.
    follow : callable
        Goes through the shots.

    Raises
    ------
    ReticleError
        The images show another reticle than the one described.
    PipelineError
        Run and calibration do not belong together, or the run has no background.
    """
    with RunReader(run_dir) as run:
        require_measurable(run_dir.name, run.header.polarity, MeasureSettings(polarity="shadow"))
        views = tuple(run.header.views)
        images, trust = _mean_transmissions(run, shots, calibration, follow)
    found = measure_reticle(
        images,
        [calibration.views[view].mapping for view in views],
        _box(calibration),
        diameters_um,
        trust=trust,
        light=light,
    )
    return SizeCalibration(
        run=run_dir.name,
        calibration=calibration.id,
        tomoshadow=version("tomoshadow"),
        light=found.condenser_ratio or "gaussian",
        light_share=found.light_share,
        blurs_px=dict(zip(views, found.blurs_px, strict=True)),
        residual=found.residual,
        middle_mm=_triple(found.middle_mm),
        normal=_triple(found.normal),
        tolerance_um=tolerance_um,
        sizes=_sizes(found, views),
    )


def _mean_transmissions(
    run: RunReader, shots: Sequence[int], calibration: Calibration, follow: Callable[[Sequence[int]], Iterable[int]]
) -> tuple[list[Intensity], list[Intensity]]:
    """Of all exposures, which must show the same; what is unknown in one is unknown."""
    references = read_references(run)
    require_backgrounds(run, references)
    first: list[Intensity] = []
    sums: list[Intensity] = []
    trusts: list[Intensity] = []
    number = 0
    for index in follow(shots):
        shot = run.read_shot(index)
        require_match(run.run_dir.name, shot, calibration)
        for frame in frame_names(run):
            images, trust = shadow_images(run, shot, frame, references)
            first = first or images
            for view, before, image, known in zip(run.header.views, first, images, trust, strict=True):
                require_still(before, image, known > 0, f"{run.run_dir.name}, shot {index}, {view}")
            sums = [a + b for a, b in zip(sums, images, strict=True)] if sums else images
            trusts = [np.minimum(a, b) for a, b in zip(trusts, trust, strict=True)] if trusts else trust
            number += 1
    return [image / np.float32(number) for image in sums], trusts


def _box(calibration: Calibration) -> Box:
    grid = default_grid(calibration)
    first, last = (grid.to_mm(np.array([corner], np.float64))[0] for corner in ((0, 0, 0), np.array(grid.shape) - 1))
    return Box(_triple(np.minimum(first, last)), _triple(np.maximum(first, last)))


def _triple(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _sizes(found: ReticleSizes, views: Sequence[str]) -> tuple[DotSizes, ...]:
    return tuple(
        DotSizes(
            true_um=group.true_um,
            found_um=group.found_um,
            sd_um=group.sd_um,
            dots=group.dots,
            views_um=dict(zip(views, group.views_um, strict=True)),
        )
        for group in found.groups
    )


def save_size_calibration(sizes: SizeCalibration, path: Path) -> None:
    """Write it as JSON; an old file is replaced."""
    with replacing(path) as part:
        part.write_text(json.dumps(sizes.model_dump(mode="json", by_alias=True), indent=2) + "\n", encoding="utf-8")


def load_size_calibration(path: Path) -> SizeCalibration:
    """Read a file of ``tomoshadow size-calibration``.

    Raises
    ------
    ReticleError
        There is no such file, it holds something else, or its reticle failed.
    """
    try:
        found = SizeCalibration.model_validate_json(path.read_text(encoding="utf-8"))
        MeasureSettings(polarity="shadow", light=found.light, sizes=found.rows)
    except OSError as error:
        raise ReticleError(f"{path}: {error.strerror}") from error
    except (ValidationError, UnicodeDecodeError) as error:
        problem = error.errors()[0] if isinstance(error, ValidationError) else None
        where = ".".join(map(str, problem["loc"])) or "light and sizes" if problem else "text"
        told = f"{where}: {problem['msg']}" if problem else "not UTF-8"
        raise ReticleError(f"{path}: no size calibration: {told}") from error
    if not found.passed:
        raise ReticleError(f"{path}: this size calibration failed: {found.reasons[0]}")
    return found
