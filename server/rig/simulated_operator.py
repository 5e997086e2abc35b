"""SimulatedOperator: what an operator does before a run, and what none could write down after it."""

from pathlib import Path

from daq.run_plan import RunPlan
from daq.simulation.laboratory import SimulatedLaboratory
from server.rig.simulated_scene import SimulatedScene

TRUTH_FILE = Path("truth", "truth.h5")
"""Where a run of a simulated rig keeps what nobody could measure; relative to the run."""


class SimulatedOperator:
    """Observes the runs of a simulated rig, see ``daq.run.active_run.RunObserver``.

    Parameters
    ----------
    scene : SimulatedScene
        Gets spray or target as a run needs it.
    laboratory : SimulatedLaboratory
        Knows what was fired.
    """

    def __init__(self, scene: SimulatedScene, laboratory: SimulatedLaboratory) -> None:
        self._scene = scene
        self._laboratory = laboratory

    def before_run(self, plan: RunPlan) -> None:
        """Spray on or off, target in."""
        self._laboratory.forget_fired()
        self._scene.prepare(plan.kind)

    def after_run(self, run_dir: Path) -> None:
        """Keep the truth of what was fired."""
        self._scene.write_truth(run_dir / TRUTH_FILE, self._laboratory.fired)
