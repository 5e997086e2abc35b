"""Assembly: the only module that names concrete drivers. They are the same on a real and on a simulated rig."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from daq.devices import Interlock, Rig
from daq.drivers.aravis_camera import AravisCamera
from daq.drivers.camera_profile import CameraProfile, load_camera_profile
from daq.drivers.gpio_interlock import GpioInterlock
from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_protocol import Reply
from daq.drivers.serial_pulse_generator import SerialPulseGenerator
from daq.drivers.serial_stage import SerialStage, StageScale
from daq.errors import DeviceUnavailable
from daq.run.shooting import RunObserver
from daq.simulation.gpio_chip import CHIP_PATH, ChipUnsupported, SimulatedSwitchLine, free_line
from daq.simulation.interlock import DoorSwitch, MemoryInterlock
from server.rig.config import RigConfig, SimulationConfig
from server.rig.device_config import PulseGeneratorConfig, StageConfig
from server.rig.far_end_guest import FarEndGuest
from server.rig.far_end_line import somebody_listens
from server.rig.far_ends import run_far_ends, simulated_generator
from server.rig.laboratory import Laboratory
from server.rig.rig_lock import far_end_address, hold_far_ends, hold_generator, hold_rig

Profiles = Mapping[str, CameraProfile]
Clock = Callable[[], float]

_GENERATOR = "pulse_generator"


@dataclass(frozen=True)
class AssembledRig:
    """An opened rig.

    Parameters
    ----------
    rig : Rig
        Its devices.
    laboratory : Laboratory | None
        Doors to open and faults to inject, where the rig is simulated.
    observers : tuple[RunObserver, ...]
        Who takes part in its runs: nobody, or the operator of a simulated rig.
    """

    rig: Rig
    laboratory: Laboratory | None = None
    observers: tuple[RunObserver, ...] = ()


@dataclass(frozen=True)
class _Wires:
    """What the drivers of a simulated rig are wired to."""

    laboratory: Laboratory
    operator: RunObserver
    interlock: Interlock
    generator_port: str
    stage_port: str
    clock_s: Clock


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
    """All devices of a rig, not yet opened. The far ends of a simulated one run until the block ends, or go on to run.

    They go on where they run in a process of their own, see ``server.rig.far_end_host``.

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


def recorded_configuration(config: RigConfig) -> dict[str, Any]:
    """What every run keeps of its rig: also what each camera is told, as its profile is a file that may change."""
    profiles = {name: load_camera_profile(view.camera.profile) for name, view in config.views.items()}
    told = {name: profile.model_dump(mode="json") for name, profile in profiles.items()}
    return {**config.model_dump(mode="json"), "camera_profiles": told}


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
    elif somebody_listens(far_end_address(config)):
        with hold_rig(config), FarEndGuest(config, MemoryInterlock("nobody's")) as guest:
            yield _with_port(config, guest.generator_port), _clock_of(config, guest.clock_s)
    else:
        with simulated_generator(config, lambda _: None) as firmware:
            yield _with_port(config, firmware.port), firmware.clock_s


def _with_port(config: RigConfig, port: str) -> RigConfig:
    return config.model_copy(update={"pulse_generator": PulseGeneratorConfig(port=port)})


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
        _GENERATOR, _port_of(config), config.channels, _current_limits_a(config), max_light_a, clock_s
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


def _wires(config: RigConfig, simulation: SimulationConfig, stack: ExitStack) -> _Wires:
    """Join the far ends that run in another process, or run them in this one."""
    interlock, switch = _interlock_and_switch(simulation)
    if somebody_listens(far_end_address(config)):
        guest = stack.enter_context(FarEndGuest(config, switch))
        return _Wires(guest, guest, interlock, guest.generator_port, guest.stage_port, _clock_of(config, guest.clock_s))
    stack.enter_context(hold_far_ends(config))
    ends = stack.enter_context(run_far_ends(config, switch))
    generator, stage = ends.devices.generator, ends.devices.stage
    return _Wires(ends.laboratory, ends.operator, interlock, generator.port, stage.port, generator.clock_s)


def _simulation(config: RigConfig, simulation: SimulationConfig, profiles: Profiles, stack: ExitStack) -> AssembledRig:
    """Far ends of all wires, then the drivers of a real rig at the near ones."""
    wires = _wires(config, simulation, stack)
    stage = config.stage and config.stage.model_copy(update={"port": wires.stage_port})
    wired = _with_port(config, wires.generator_port).model_copy(update={"stage": stage})
    return AssembledRig(_rig(wired, profiles, wires.interlock, wires.clock_s), wires.laboratory, (wires.operator,))


def _clock_of(config: RigConfig, clock_s: Clock) -> Clock:
    """An emulated generator is slower than the clock on the wall; any other one needs not be asked."""
    return clock_s if config.simulation is not None and config.simulation.firmware == "emulated" else time.monotonic


def _interlock_and_switch(simulation: SimulationConfig) -> tuple[Interlock, DoorSwitch]:
    """The simulated chip exists in one process only: that of the interlock, which moves its line as the door does."""
    if simulation.gpio != "memory":
        try:
            line = free_line()
            return GpioInterlock("interlock", CHIP_PATH, line), SimulatedSwitchLine(line)
        except ChipUnsupported as reason:
            if simulation.gpio == "chip":
                raise DeviceUnavailable("interlock", f"simulation.gpio is 'chip', but {reason}") from reason
    memory = MemoryInterlock("interlock")
    return memory, memory
