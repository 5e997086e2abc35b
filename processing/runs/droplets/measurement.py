"""One shot + one calibration -> droplets on disk. Every shot by itself, whoever asks for it."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.files.run_directory import RunReader, Shot
from processing.analysis.copied_shots import IMAGES
from processing.analysis.droplets.bright_shot import measure_bright
from processing.analysis.droplets.droplet_file import write_droplets
from processing.analysis.droplets.droplet_search import DropletSearch, plan_droplets
from processing.analysis.droplets.shadows.shadow_shot import measure_shadows
from processing.analysis.droplets.size_correction import SizeCorrection
from processing.analysis.near_or_far import SIGHTS, depth_reversed
from processing.analysis.stored_json import stored_json
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import load_calibration
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.planning.calibrated_plan import default_grid, telling_where
from processing.reconstruction.settings import GridSettings
from processing.runs.droplets.measure_settings import METHOD_VERSION, MeasureSettings, require_measurable
from processing.runs.droplets.measured_shot import (
    Exposure,
    MeasuredShot,
    ShotVelocity,
    compared,
    droplets_path,
    shot_summary,
    shot_velocities,
)
from processing.runs.droplets.run_light import RunLight, known_shadows
from processing.runs.errors import Stopped
from processing.runs.exposure_faults import images_print
from processing.runs.liquid.objects import RunObjects, told_objects
from processing.runs.measured_images import (
    bright_images,
    odd_backgrounds,
    require_backgrounds,
    require_fitting,
)
from processing.runs.not_checked import KNOWN, KnownImages
from processing.runs.recipe import recipe_sha256
from processing.runs.results_file import FrameName, Provenance, claim_results, provenance_of
from processing.runs.shots.separation import separation_of
from processing.runs.shots.shot_images import frame_names, require_match
from processing.runs.shots.stated_lengths import untold_doubt
from processing.runs.shots.turned_views import sights_in
from processing.runs.sprays.conditions import conditions_of
from processing.runs.workbench import References, read_references

_Found = tuple[Exposure, Sequence[Intensity], tuple[str, ...]]
"""What an exposure shows, its images with droplets bright, and why they are no good."""


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
        What held of the run and was known of its images when the measurement was planned, whatever is mended meanwhile.
    light : RunLight
        In which shots with few droplets are, as others of the run say.
    """

    run: RunReader
    calibration: Calibration
    settings: MeasureSettings
    search: DropletSearch
    references: References
    provenance: Provenance
    objects: RunObjects
    conditions: dict[str, str]
    light: RunLight

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
        mappings = [calibration.views[view].mapping for view in views]
        with telling_where(calibration, grid):
            search = plan_droplets(mappings, grid, views, margin_voxel=settings.margin_voxel)
        references = read_references(run) if references is None else references
        if settings.polarity == "shadow":
            require_backgrounds(run, references)
        require_fitting(settings.ignored, {view: calibration.views[view].mapping.image_size_px for view in views})
        provenance = provenance_of(run, calibration, calibration_file, settings, METHOD_VERSION)
        known = {KNOWN: KnownImages.of(run.header, calibration, grid).model_dump_json()}
        objects = RunObjects.of(run, calibration, references, grid, settings.nozzle, settings.ignored)
        light = RunLight(run, search, references, settings.ignored)
        return cls(
            run, calibration, settings, search, references, provenance, objects, conditions_of(run) | known, light
        )

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
        frames = frame_names(self.run)
        measured = [self._exposure(recorded, frame, threads, should_stop) for frame in frames]
        exposures = tuple(exposure for exposure, _ in measured)
        separation, axis = separation_of(self.run, recorded), stored_json(self.conditions, "spray").get("axis")
        velocities, velocity = shot_velocities(exposures, self.search.grid, separation, axis)
        by_frame = dict(zip(frames, exposures := compared(exposures, velocities), strict=True))
        seen = {frame: exposure.droplets for frame, exposure in by_frame.items() if exposure.views}
        objects = self.objects.measure(recorded, seen, threads)
        told = {frame: {**one.told(), **told_objects(objects.get(frame))} for frame, one in by_frame.items()}
        sights = measured[0][1]
        file = droplets_path(results_dir, shot)
        write_droplets(
            file,
            {str(frame): exposure.droplets for frame, exposure in by_frame.items()},
            {
                **self.provenance,
                **self._told_of(shot, told, velocity),
                SIGHTS: json.dumps(sights),
                IMAGES: images_print(recorded, frames).hex(),
            },
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
        sights = sights_in(self.calibration, list(shot.views), lights) if frame != "b" else {}
        doubts = (depth_reversed(sights), untold_doubt(self.run.header, self.calibration))
        return exposure.doubted((*reasons, *filter(None, doubts)), before=True), sights

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
        images, trust = known_shadows(self.run, shot, frame, self.references, self.settings.ignored)
        measured = measure_shadows(
            images,
            self.search,
            trust=trust,
            light=self.settings.light,
            sizes=SizeCorrection.of(self.settings.sizes) if self.settings.sizes else None,
            twins=self.settings.twins,
            seed=self.settings.seed + shot.index,
            threads=threads,
            before_round=before_round,
            known_light=lambda: self.light.seen(threads, before_round),
        )
        return measured, [1 - one for one in images], odd_backgrounds(self.run, shot, frame, self.references)
