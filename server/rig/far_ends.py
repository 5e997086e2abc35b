"""The far ends of a simulated rig, in this process: devices at the other end of every wire, and who moves them."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from daq.drivers.camera_profile import CameraProfile, load_camera_profile
from daq.shot import FiredTrain
from daq.simulation.camera.gige_camera import SimulatedCamera
from daq.simulation.interlock import DoorSwitch
from daq.simulation.laboratory import SimulatedLaboratory
from daq.simulation.mishaps import SimulatedDevices
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.simulation.stage import SimulatedStage
from server.rig.config import RigConfig, SimulationConfig, ViewConfig
from server.rig.simulated_operator import SimulatedOperator
from server.rig.simulated_scene import SimulatedScene

PortOf = Callable[[str], Path | None]
"""Where the serial port of a device shall be; None: anywhere."""
_STAGE_SPEED_MM_S = 100.0


def _anywhere(_: str) -> Path | None:
    return None


@dataclass(frozen=True)
class FarEnds:
    """All of them, running."""

    laboratory: SimulatedLaboratory
    operator: SimulatedOperator

    @property
    def devices(self) -> SimulatedDevices:
        """Cameras, generator, door and stage."""
        return self.laboratory.devices


@contextmanager
def run_far_ends(config: RigConfig, switch: DoorSwitch, port_of: PortOf = _anywhere) -> Iterator[FarEnds]:
    """Run the far ends of a simulated rig until the block ends.

    Parameters
    ----------
    config : RigConfig
        A rig with a simulation.
    switch : DoorSwitch
        The door, on the computer's side; that of the generator is moved with it.
    port_of : PortOf
        Where ``pulse_generator`` and ``stage`` shall have their serial ports.

    Raises
    ------
    DeviceError
        A simulated device cannot run.
    PlanError
        A camera profile cannot be read.
    """
    simulation = _simulation_of(config)
    with ExitStack() as stack:
        laboratory = stack.enter_context(SimulatedLaboratory(simulation.faults))
        stage = stack.enter_context(_stage(config, simulation, port_of("stage")))
        zero_mm = 0.0 if config.stage is None else config.stage.zero_mm
        scene = SimulatedScene(config, lambda: stage.position_mm - zero_mm)
        cameras = {name: stack.enter_context(_camera(name, view, scene)) for name, view in config.views.items()}
        generator = stack.enter_context(simulated_generator(config, laboratory.on_fired, port_of("pulse_generator")))
        operator = SimulatedOperator(scene)
        laboratory.witnesses.append(operator.on_fired)
        laboratory.connect(SimulatedDevices(cameras, generator, switch, stage))
        stack.callback(laboratory.disconnect)
        yield FarEnds(laboratory, operator)


def simulated_generator(
    config: RigConfig, on_fired: Callable[[FiredTrain], None], port: Path | None = None
) -> FirmwareProcess:
    """The pulse generator of a simulated rig, not yet plugged in."""
    emulated = _simulation_of(config).firmware == "emulated"
    return FirmwareProcess(config.channels, on_fired, emulated=emulated, port=port)


def _simulation_of(config: RigConfig) -> SimulationConfig:
    if config.simulation is None:
        raise ValueError(f"rig {config.name}: has no [simulation]")
    return config.simulation


def _stage(config: RigConfig, simulation: SimulationConfig, port: Path | None) -> SimulatedStage:
    stage = config.stage
    if stage is None:
        return SimulatedStage(seed=simulation.seed, port=port)
    return SimulatedStage(
        travel_mm=2 * max(stage.zero_mm + stage.range_mm[1], 1.0),
        speed_mm_s=_STAGE_SPEED_MM_S,
        microstep_um=stage.microstep_um,
        seed=simulation.seed,
        port=port,
    )


def _camera(name: str, view: ViewConfig, scene: SimulatedScene) -> SimulatedCamera:
    profile: CameraProfile = load_camera_profile(view.camera.profile)
    return SimulatedCamera(
        name,
        view.camera.ip,
        f"sim-{name}"[:15],
        profile.camera_timing,
        scene.expose,
        (view.sensor.height_px, view.sensor.width_px),
    )
