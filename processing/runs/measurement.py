"""One shot + one calibration -> droplets on disk. Every shot by itself, whoever asks for it."""

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from daq.files.run_directory import RunReader, Shot
from processing.analysis.copied_shots import IMAGES
from processing.analysis.droplets.bright_shot import measure_bright
from processing.analysis.droplets.droplet_file import write_droplets
from processing.analysis.droplets.droplet_search import MARGIN_VOXEL, DropletSearch, plan_droplets
from processing.analysis.droplets.shadows.light_search import Light
from processing.analysis.droplets.shadows.shadow_shot import measure_shadows
from processing.analysis.droplets.size_correction import SizeCorrection, SizeRows
from processing.analysis.near_or_far import SIGHTS, depth_reversed
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import load_calibration
from processing.calibration.droplets.droplet_images import find_droplets
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity, Polarity
from processing.reconstruction.settings import FrozenValue, GridSettings
from processing.runs.errors import PipelineError
from processing.runs.exposure_faults import images_print
from processing.runs.liquid.objects import NozzleNumbers, RunObjects, told_objects
from processing.runs.measured_images import (
    IgnoredPixels,
    bright_images,
    odd_backgrounds,
    require_backgrounds,
    require_fitting,
    shadow_images,
    without_ignored,
)
from processing.runs.measured_shot import (
    Exposure,
    MeasuredShot,
    ShotVelocity,
    doubted,
    droplets_path,
    shot_summary,
    shot_velocities,
)
from processing.runs.pipeline import Stopped, default_grid, provenance_of
from processing.runs.recipe import recipe_sha256
from processing.runs.results_file import FrameName, Provenance, claim_results
from processing.runs.shots.separation import separation_of
from processing.runs.shots.shot_images import frame_names, require_match
from processing.runs.shots.turned_views import meeting_sights
from processing.runs.sprays.conditions import conditions_of
from processing.runs.workbench import References, read_references

_Found = tuple[Exposure, Sequence[Intensity], tuple[str, ...]]
"""What an exposure shows, its images with droplets bright, and why they are no good."""
METHOD_VERSION = 10
"""Of what the numbers in a file of droplets mean."""


class MeasureSettings(FrozenValue):
    """How droplets are measured; travels with every result."""

    polarity: Annotated[Polarity, Field(description="bright particles on black, or shadows")] = "bright"
    grid: Annotated[GridSettings | None, Field(description="default: what all views see, one voxel per pixel")] = None
    margin_voxel: Annotated[int, Field(ge=0, le=500, description="so far around the grid droplets are looked for")] = (
        MARGIN_VOXEL
    )
    twins: Annotated[
        int, Field(ge=0, le=100, description="simulated twins per exposure in which ghosts are counted; 0: none")
    ] = 0
    seed: Annotated[int, Field(ge=0, description="of the twins")] = 0
    light: Annotated[Light, Field(description="of shadows: condenser ratio; incoherent, gaussian or estimated")] = (
        "estimated"
    )
    sizes: Annotated[SizeRows, Field(description="of the dots of a reticle, um: found in this light, true, sd")] = ()
    ignored: Annotated[
        tuple[IgnoredPixels, ...],
        Field(description="rectangles of shadow images that are not asked, VIEW=LEFT:RIGHT,TOP:BOTTOM in px"),
    ] = ()
    nozzle: Annotated[NozzleNumbers | None, Field(description="x, y, z in mm, and axis; default: the run's own")] = None

    @model_validator(mode="after")
    def _sizes_of_one_light(self) -> Self:
        if self.sizes and self.light == "estimated":
            raise ValueError("sizes were found in one light: state it, as size-calibration does")
        return self

    def results_id(self, calibration: str) -> str:
        """Name of the results directory: droplets, and a hash of method, settings and the calibration's name."""
        digest = hashlib.sha256(f"{calibration}\n{recipe_sha256('measure', METHOD_VERSION, self)}".encode()).hexdigest()
        return f"droplets-{digest[:8]}"


def require_measurable(run_name: str, recorded: Polarity, settings: MeasureSettings) -> None:
    """Refuse what cannot be measured, before anything is read.

    Raises
    ------
    PipelineError
        A polarity other than the run's, or settings of shadows for bright particles.
    """
    if settings.polarity != recorded:
        raise PipelineError(
            f"{run_name}: its images are recorded as {recorded}, they are not measured as {settings.polarity}"
        )
    for stated, what in ((settings.ignored, "pixels to ignore are"), (settings.nozzle, "a nozzle is")):
        if recorded == "bright" and stated:
            raise PipelineError(f"{what} for shadows: of bright particles all pixels are asked, none hang together")
    if recorded == "bright" and settings.light != "estimated":
        raise PipelineError(f"light {settings.light} is for shadows: bright particles have no diameter to correct")


@dataclass(frozen=True, eq=False)
class RunMeasurement:
    """What the shots of a run share when they are measured.

    Parameters
    ----------
    run : RunReader
        The recorded run.
    calibration : Calibration
        Of its views.
    settings : MeasureSettings
        How.
    search : DropletSearch
        Where droplets are looked for.
    references : References
        Of the run.
    provenance : Provenance
        Where the droplets come from, but for the shot.
    objects : RunObjects
        How liquid that is no droplet is looked for.
    conditions : dict of str to str
        What held of the run when the measurement was planned, whatever is mended meanwhile.
    """

    run: RunReader
    calibration: Calibration
    settings: MeasureSettings
    search: DropletSearch
    references: References
    provenance: Provenance
    objects: RunObjects
    conditions: dict[str, str]

    @classmethod
    def of(
        cls,
        run: RunReader,
        shot: int,
        calibration_file: Path,
        settings: MeasureSettings,
        references: References | None = None,
    ) -> "RunMeasurement":
        """Plan the measurement of all shots by one of them; somebody may have read the references of the run already.

        Raises
        ------
        PipelineError
            The shot is not valid, run and calibration do not belong together, settings are not for its polarity, a run
            of shadows has no background, or pixels to ignore are in no image.
        CalibrationError
            The calibration was refused.
        ReconstructionError
            Its views see too little in common, or are too few.
        """
        calibration = load_calibration(calibration_file)
        require_measurable(run.run_dir.name, run.header.polarity, settings)
        require_match(run.run_dir.name, run.read_shot(shot), calibration)
        views = tuple(run.header.views)
        grid = settings.grid.to_grid() if settings.grid else default_grid(calibration)
        search = plan_droplets(
            [calibration.views[view].mapping for view in views], grid, views, margin_voxel=settings.margin_voxel
        )
        references = read_references(run) if references is None else references
        if settings.polarity == "shadow":
            require_backgrounds(run, references)
        require_fitting(settings.ignored, {view: calibration.views[view].mapping.image_size_px for view in views})
        provenance = provenance_of(run, calibration, calibration_file, settings, METHOD_VERSION)
        objects = RunObjects.of(run, calibration, references, grid, settings.nozzle, settings.ignored)
        return cls(run, calibration, settings, search, references, provenance, objects, conditions_of(run))

    def measure(
        self,
        shot: int,
        results_dir: Path,
        threads: int = DEFAULT_THREADS,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> MeasuredShot:
        """Measure every exposure of one shot and write its droplets.

        Parameters
        ----------
        shot : int
            Index of the shot.
        results_dir : Path
            Receives the droplets; a file of the same shot and settings is replaced atomically.
        threads : int
            The droplets do not depend on it.
        should_stop : callable
            Asked before each exposure and each round of the search.

        Raises
        ------
        PipelineError
            The shot is not valid.
        Stopped
            ``should_stop`` said so.
        VolumeFileError
            The directory holds results of something else.
        """
        started_cpu_s = time.process_time()
        recorded = self.run.read_shot(shot)
        require_match(self.run.run_dir.name, recorded, self.calibration)
        claim_results(results_dir, self.provenance)
        measured = [self._exposure(recorded, frame, threads, should_stop) for frame in frame_names(self.run)]
        exposures = tuple(exposure for exposure, _ in measured)
        by_frame = dict(zip(frame_names(self.run), exposures, strict=True))
        velocities, velocity = shot_velocities(exposures, self.search.grid, separation_of(self.run, recorded))
        droplets = {frame: one.droplets for frame, one in by_frame.items() if one.views}
        objects = self.objects.measure(recorded, droplets, threads)
        told = {frame: {**one.told(), **told_objects(objects.get(frame))} for frame, one in by_frame.items()}
        file = droplets_path(results_dir, shot)
        seen = {SIGHTS: json.dumps(measured[0][1]), IMAGES: images_print(recorded, tuple(by_frame)).hex()}
        write_droplets(
            file,
            {str(frame): one.droplets for frame, one in by_frame.items()},
            {**self.provenance, **self._told_of(shot, told, velocity), **seen},
            velocities=velocities.columns() if velocities else None,
            objects={str(frame): moving for frame, moving in objects.items()},
        )
        summary = shot_summary(shot, exposures, velocity, time.process_time() - started_cpu_s, file)
        return MeasuredShot(summary, exposures, velocities)

    def _told_of(
        self, shot: int, told: Mapping[FrameName, Mapping[str, object]], velocity: ShotVelocity | str
    ) -> Provenance:
        reason = {"reason": velocity} if isinstance(velocity, str) else velocity.model_dump(mode="json")
        return {
            "shot": shot,
            "grid": GridSettings.of(self.search.grid).model_dump_json(),
            "recipe_sha256": recipe_sha256("measure", METHOD_VERSION, self.settings),
            "exposures": json.dumps(told),
            "velocity": json.dumps(reason),
            **self.conditions,
            **({"rate_hz": rate_hz} if (rate_hz := self.run.header.rate_hz) else {}),
        }

    def _exposure(
        self, shot: Shot, frame: FrameName, threads: int, should_stop: Callable[[], bool]
    ) -> tuple[Exposure, dict[str, int]]:
        """What an exposure shows, and at how many droplets lines of sight meet; B has the cameras of A."""

        def before_round() -> None:
            if should_stop():
                raise Stopped(f"{self.run.run_dir.name}, shot {shot.index}: stopped in exposure {frame}")

        before_round()
        measure = self._bright if self.settings.polarity == "bright" else self._shadows
        exposure, lights, reasons = measure(shot, frame, threads, before_round)
        sights = self._sights(shot, lights) if frame != "b" else {}
        return doubted(exposure, (*reasons, *filter(None, [depth_reversed(sights)]))), sights

    def _bright(self, shot: Shot, frame: FrameName, threads: int, before_round: Callable[[], None]) -> _Found:
        images = bright_images(self.run, shot, frame, self.references)
        measured = measure_bright(
            images,
            self.search,
            twins=self.settings.twins,
            seed=self.settings.seed + shot.index,
            threads=threads,
            before_round=before_round,
        )
        brightest = max(float(np.percentile(image[::4, ::4], 99.9)) for image in images)
        return measured, [image / max(brightest, 1e-6) for image in images], ()

    def _shadows(self, shot: Shot, frame: FrameName, threads: int, before_round: Callable[[], None]) -> _Found:
        images, trust = shadow_images(self.run, shot, frame, self.references)
        measured = measure_shadows(
            images,
            self.search,
            trust=list(without_ignored(dict(zip(shot.views, trust, strict=True)), self.settings.ignored).values()),
            light=self.settings.light,
            sizes=SizeCorrection.of(self.settings.sizes) if self.settings.sizes else None,
            twins=self.settings.twins,
            seed=self.settings.seed + shot.index,
            threads=threads,
            before_round=before_round,
        )
        return measured, [1 - one for one in images], odd_backgrounds(shot, frame, self.references)

    def _sights(self, shot: Shot, lights: Sequence[Intensity]) -> dict[str, int]:
        views = {name: self.calibration.views[name] for name in shot.views}
        seen = [find_droplets(np.clip(light, 0, None)) for light in lights]
        return meeting_sights(replace(self.calibration, views=views), [seen])
