"""Assembly: the only module that names concrete devices. Drivers are the same on a real and on a simulated rig."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from daq.devices import Interlock, Rig
from daq.drivers.aravis_camera import AravisCamera
from daq.drivers.camera_profile import CameraProfile, load_camera_profile
from daq.drivers.gpio_interlock import GpioInterlock
from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_protocol import Reply
from daq.drivers.serial_pulse_generator import SerialPulseGenerator
from daq.drivers.serial_stage import SerialStage, StageScale
from daq.errors import DeviceUnavailable
from daq.run.active_run import RunObserver
from daq.shot import FiredTrain
from daq.simulation.camera.gige_camera import SimulatedCamera
from daq.simulation.gpio_chip import CHIP_PATH, ChipUnsupported, SimulatedSwitchLine, free_line
from daq.simulation.interlock import DoorSwitch, MemoryInterlock
from daq.simulation.laboratory import SimulatedLaboratory
from daq.simulation.mishaps import SimulatedDevices
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.simulation.stage import SimulatedStage
from server.rig.config import (
    PulseGeneratorConfig,
    RigConfig,
    SimulationConfig,
    StageConfig,
    ViewConfig,
)
from server.rig.rig_lock import hold_generator, hold_rig
from server.rig.simulated_operator import SimulatedOperator
from server.rig.simulated_scene import SimulatedScene

Profiles = Mapping[str, CameraProfile]
Clock = Callable[[], float]

_GENERATOR = "pulse_generator"
_STAGE_SPEED_MM_S = 100.0


@dataclass(frozen=True)
class AssembledRig:
    """An opened rig.

    Parameters
    ----------
    rig : Rig
        Its devices.
    laboratory : SimulatedLaboratory | None
        Doors to open and faults to inject, where the rig is simulated.
    observers : tuple[RunObserver, ...]
        Who takes part in its runs: nobody, or the operator of a simulated rig.
    """

    rig: Rig
    laboratory: SimulatedLaboratory | None = None
    observers: tuple[RunObserver, ...] = ()


@contextmanager
def open_rig(config: RigConfig) -> Iterator[AssembledRig]:
    """Open all devices of a rig, real or simulated; the light goes off first when the block ends.

    Raises
    ------
    AlreadyHeld
        Another process works with this rig, or with one that has a device of it; names the process.
    DeviceError
        A device is absent, held by somebody else, or does not answer; names it.
    PlanError
        A camera profile cannot be read.
    """
    with wire_rig(config) as wired, ExitStack() as devices:
        for device in wired.rig.devices:
            devices.enter_context(device)
        yield wired


@contextmanager
def wire_rig(config: RigConfig) -> Iterator[AssembledRig]:
    """All devices of a rig, not yet opened; of a simulated one, the far ends run until the block ends.

    Raises
    ------
    AlreadyHeld
        Another process works with this rig, or with one that has a device of it; names the process.
    DeviceError
        A simulated far end cannot run.
    PlanError
        A camera profile cannot be read.
    """
    profiles = {name: load_camera_profile(view.camera.profile) for name, view in config.views.items()}
    with hold_rig(config), ExitStack() as far_ends:
        if config.simulation is None:
            yield AssembledRig(_rig(config, profiles, _gpio_interlock(config)))
        else:
            yield _simulation(config, config.simulation, profiles, far_ends)


@contextmanager
def open_generator(config: RigConfig) -> Iterator[SerialPulseGenerator]:
    """Open the pulse generator alone, without the cameras; on a simulated rig nobody sees its light."""
    with _generator_wired(config) as (wired, clock_s), _pulse_generator(wired, clock_s) as generator:
        yield generator


@contextmanager
def open_pulse_line(config: RigConfig) -> Iterator[tuple[PulseLine, Reply]]:
    """Open the line of the pulse generator and return what it says it is; the generator is off at the end."""
    with _generator_wired(config) as (wired, clock_s):
        line = PulseLine(_GENERATOR, _port_of(wired), clock_s)
        identity = line.open()
        try:
            yield line, identity
            line.off()
        finally:
            line.close()


@contextmanager
def _generator_wired(config: RigConfig) -> Iterator[tuple[RigConfig, Clock]]:
    """Yield the configuration, with the port of a simulated generator where the rig is simulated, and its time."""
    if config.simulation is None:
        with hold_generator(config):
            yield config, time.monotonic
        return
    with _simulated_generator(config, lambda _: None) as firmware:
        port = PulseGeneratorConfig(port=firmware.port)
        yield config.model_copy(update={"pulse_generator": port}), firmware.clock_s


def _simulated_generator(config: RigConfig, on_fired: Callable[[FiredTrain], None]) -> FirmwareProcess:
    emulated = config.simulation is not None and config.simulation.firmware == "emulated"
    return FirmwareProcess(channels_of(config), on_fired, emulated=emulated)


def _rig(config: RigConfig, profiles: Profiles, interlock: Interlock, clock_s: Clock = time.monotonic) -> Rig:
    stage, network = None if config.stage is None else _stage(config.stage), config.network.to_network()
    cameras = {
        name: AravisCamera(
            name,
            view.camera.ip,
            profiles[name],
            (view.sensor.height_px, view.sensor.width_px),
            network,
        )
        for name, view in config.views.items()
    }
    generator = _pulse_generator(config, clock_s)
    return Rig(cameras, generator, interlock, stage, max_current_a=_current_limits_a(config), network=network)


def _pulse_generator(config: RigConfig, clock_s: Clock) -> SerialPulseGenerator:
    max_light_a = {name: view.max_light_a for name, view in config.views.items()}
    return SerialPulseGenerator(
        _GENERATOR, _port_of(config), channels_of(config), _current_limits_a(config), max_light_a, clock_s
    )


def _current_limits_a(config: RigConfig) -> dict[str, float]:
    return {name: view.max_current_a for name, view in config.views.items()}


def _port_of(config: RigConfig) -> str:
    if config.pulse_generator is None:
        raise ValueError(f"rig {config.name}: has no pulse generator")
    return config.pulse_generator.port


def _gpio_interlock(config: RigConfig) -> GpioInterlock:
    if config.interlock is None:
        raise ValueError(f"rig {config.name}: has no interlock")
    wire = config.interlock
    return GpioInterlock("interlock", wire.chip, wire.line, active_low=wire.active_low)


def _stage(stage: StageConfig) -> SerialStage:
    return SerialStage("stage", stage.port, stage.range_mm, scale=StageScale(stage.microstep_um, stage.zero_mm))


def channels_of(config: RigConfig) -> dict[str, int]:
    """Channel of the pulse generator by view."""
    return {name: view.led_channel for name, view in config.views.items()}


def _simulation(
    config: RigConfig, simulation: SimulationConfig, profiles: Profiles, far_ends: ExitStack
) -> AssembledRig:
    """Simulated devices at the far ends of all wires, then the drivers of a real rig at the near ones."""
    laboratory = far_ends.enter_context(SimulatedLaboratory(simulation.faults))
    interlock, switch = _interlock_and_switch(simulation)
    stage = far_ends.enter_context(_simulated_stage(config, simulation))
    zero_mm = 0.0 if config.stage is None else config.stage.zero_mm
    scene = SimulatedScene(config, lambda: stage.position_mm - zero_mm)
    cameras = {
        name: far_ends.enter_context(_simulated_camera(name, view, profiles[name], scene))
        for name, view in config.views.items()
    }
    generator = far_ends.enter_context(_simulated_generator(config, laboratory.on_fired))
    laboratory.connect(SimulatedDevices(cameras, generator, switch, stage))
    far_ends.callback(laboratory.disconnect)
    wired = config.model_copy(
        update={
            "pulse_generator": PulseGeneratorConfig(port=generator.port),
            "stage": config.stage and config.stage.model_copy(update={"port": stage.port}),
        }
    )
    operator = SimulatedOperator(scene)
    laboratory.witnesses.append(operator.on_fired)
    return AssembledRig(_rig(wired, profiles, interlock, generator.clock_s), laboratory, (operator,))


def _interlock_and_switch(simulation: SimulationConfig) -> tuple[Interlock, DoorSwitch]:
    if simulation.gpio != "memory":
        try:
            line = free_line()
            return GpioInterlock("interlock", CHIP_PATH, line), SimulatedSwitchLine(line)
        except ChipUnsupported as reason:
            if simulation.gpio == "chip":
                raise DeviceUnavailable("interlock", f"simulation.gpio is 'chip', but {reason}") from reason
    memory = MemoryInterlock("interlock")
    return memory, memory


def _simulated_stage(config: RigConfig, simulation: SimulationConfig) -> SimulatedStage:
    stage = config.stage
    if stage is None:
        return SimulatedStage(seed=simulation.seed)
    return SimulatedStage(
        travel_mm=2 * max(stage.zero_mm + stage.range_mm[1], 1.0),
        speed_mm_s=_STAGE_SPEED_MM_S,
        microstep_um=stage.microstep_um,
        seed=simulation.seed,
    )


def _simulated_camera(name: str, view: ViewConfig, profile: CameraProfile, scene: SimulatedScene) -> SimulatedCamera:
    return SimulatedCamera(
        name,
        view.camera.ip,
        f"sim-{name}"[:15],
        profile.camera_timing,
        scene.expose,
        (view.sensor.height_px, view.sensor.width_px),
    )
