"""SimulatedOperator: what an operator does before a run, and what none could write down while it goes."""

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from daq.errors import DeviceError, DeviceTimeout
from daq.run_plan import RunKind, RunPlan
from daq.shot import FiredTrain
from processing.synthetic.truth_file import write_true_cameras, write_true_spray
from server.rig.simulated_scene import SimulatedScene

TRUTH_FILE = Path("truth", "truth.h5")
"""Where a run of a simulated rig keeps what nobody could measure; relative to the run."""
_DRAIN_S = 20.0


class SimulatedOperator:
    """Observes the runs of a simulated rig, see ``daq.run.shooting.RunObserver``.

    Parameters
    ----------
    scene : SimulatedScene
        Gets spray or target as a run needs it.
    """

    def __init__(self, scene: SimulatedScene) -> None:
        self._scene = scene
        self._truth: _TruthWriter | None = None

    def before_run(self, plan: RunPlan, run_dir: Path | None) -> None:
        """Spray on or off, target in; the truth begins. A run before that nobody has ended is over."""
        self._scene.prepare(plan.kind)
        has_spray = plan.kind is RunKind.SAMPLE
        self._truth = _TruthWriter(run_dir / TRUTH_FILE, self._scene, has_spray=has_spray) if run_dir else None

    def on_fired(self, train: FiredTrain) -> None:
        """Keep the truth of one firing; returns at once."""
        if self._truth is not None:
            self._truth.note(train)

    def after_run(self, run_dir: Path) -> None:
        """See that the truth of this run is complete.

        Raises
        ------
        DeviceError
            It could not be written; the text says why.
        """
        truth = self._truth
        if truth is not None and truth.path == run_dir / TRUTH_FILE:
            self._truth = None
            truth.finish()


class _TruthWriter:
    """Writes the truth of one run as it goes, in a thread of its own: the generator waits for no disk."""

    def __init__(self, path: Path, scene: SimulatedScene, *, has_spray: bool) -> None:
        self.path = path
        self._scene, self._has_spray = scene, has_spray
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="truth")
        self._newest: Future[None] | None = None
        self._problem: BaseException | None = None
        write_true_cameras(path, scene.cameras)

    def note(self, train: FiredTrain) -> None:
        if self._has_spray:
            self._newest = self._thread.submit(self._write, train)
            self._newest.add_done_callback(self._remember)

    def finish(self) -> None:
        self._thread.shutdown(wait=False)
        try:
            newest = self._newest and self._newest.exception(_DRAIN_S)
        except TimeoutError as error:
            raise DeviceTimeout("simulated rig", f"write {self.path}", _DRAIN_S) from error
        if problem := self._problem or newest:
            raise DeviceError("simulated rig", f"{self.path}: the truth is not complete: {problem}")

    def _write(self, train: FiredTrain) -> None:
        write_true_spray(self.path, train.sequence, self._scene.liquid(train))

    def _remember(self, written: Future[None]) -> None:
        self._problem = self._problem or written.exception()
