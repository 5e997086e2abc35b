"""RunWork: what can be made of a run, and how far that is."""

import asyncio
from collections.abc import Callable

from nicegui import ui

from daq.counted import counted
from daq.run_plan import RunKind
from processing.reconstruction.choices import Accuracy, VoxelType
from processing.reconstruction.choices import ReconstructionMethod as Method
from server.lab.droplets.measurement import request_measurement, settings_within
from server.lab.jobs.job import Job, calibration_job
from server.lab.jobs.work_progress import WorkProgress
from server.lab.reconstruction import request_reconstruction
from server.lab.runs.run_summary import ACTIVE, DAMAGED, PACKED, RunSummary
from server.lab.services import Context
from server.web.ui.asking import queue
from server.web.ui.visiting import for_operators

_SHOWN = 4


class RunWork:
    """Buttons of one run at a time, and a line for each of the result sets that were asked for last."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._run_id = ""
        chosen = context.services.settings
        with ui.element("div").classes("work-row"):
            with ui.element("div").classes("work-row") as self._of_samples:
                self._method = _choice("Method", {one.value: one.value.upper() for one in Method}, chosen.method)
                self._accuracy = _choice("Accuracy", {one.value: one.value for one in Accuracy}, chosen.accuracy)
                self._voxels = _choice("Voxels", {one.value: one.value for one in VoxelType}, chosen.voxels)
                for_operators(ui.button("Reconstruct", on_click=self._reconstruct).props("outline dense no-caps"))
                self._box = for_operators(ui.input("Box / mm", placeholder="-5:5,-1:0,-5:5").props("dense outlined"))
                self._box.tooltip("X0:X1,Y0:Y1,Z0:Z1 of the droplets to measure; empty: all that the views see")
                for_operators(ui.button("Measure", on_click=self._measure).props("outline dense no-caps"))
            self._calibrate_button = for_operators(ui.button("Calibrate", on_click=self._calibrate))
            self._calibrate_button.props("outline dense no-caps")
        self._progress = ui.column().classes("w-full gap-1").props('role=status aria-label="work on this run"')
        self.show(None)

    def show(self, run: RunSummary | None) -> None:
        """Offer what can be made of a run; of one that is being recorded, or cannot be read, nothing."""
        self._run_id = run.run_id if run else ""
        kind = run.kind if run and can_be_worked_on(run) else RunKind.DARK
        self._of_samples.set_visibility(kind in (RunKind.SAMPLE, None))
        self._calibrate_button.set_visibility(kind is RunKind.CALIBRATION)

    async def reload(self) -> None:
        """Say how far the work is."""
        sets = await asyncio.to_thread(self._context.jobs.progress, self._run_id) if self._run_id else []
        self._progress.clear()
        with self._progress:
            for one in sets[:_SHOWN]:
                with ui.row().classes("w-full items-center no-wrap gap-2"):
                    bar = ui.linear_progress(one.done / one.shots, show_value=False, size="6px")
                    bar.classes("w-24").props(
                        f"rounded color={'negative' if one.failed else 'primary'} aria-hidden=true"
                    )
                    ui.label(progress_text(one)).classes("text-xs")

    async def _reconstruct(self) -> None:
        chosen = {
            "method": Method(self._method.value),
            "accuracy": Accuracy(self._accuracy.value),
            "voxels": VoxelType(self._voxels.value),
        }
        settings = self._context.services.settings.model_copy(update=chosen)
        await self._queue(lambda: request_reconstruction(self._context, self._run_id, None, None, settings))

    async def _measure(self) -> None:
        box = self._box.value or ""
        await self._queue(lambda: self._measurement(box))

    def _measurement(self, box: str) -> list[Job]:
        settings = settings_within(self._context, self._run_id, box)
        return request_measurement(self._context, self._run_id, None, None, settings)

    async def _calibrate(self) -> None:
        job = calibration_job(self._run_id, f"{self._run_id}-pinhole", "pinhole")
        await self._queue(lambda: [self._context.runner.submit(job)])

    async def _queue(self, request: Callable[[], list[Job]]) -> None:
        await queue(request)
        await self.reload()


def can_be_worked_on(run: RunSummary) -> bool:
    """Whether anything can be made of a run."""
    return run.outcome not in (ACTIVE, DAMAGED, PACKED) and run.kind in (RunKind.SAMPLE, RunKind.CALIBRATION, None)


def progress_text(one: WorkProgress) -> str:
    """How far a result set is."""
    failed = f", {one.failed} failed or aborted" if one.failed else ""
    return f"{one.results_id}: {one.done} of {counted(one.shots, 'shot')} done{failed}"


def _choice(label: str, options: dict[str, str], value: str) -> ui.select:
    return for_operators(ui.select(options, value=str(value), label=label).props("dense outlined options-dense"))
