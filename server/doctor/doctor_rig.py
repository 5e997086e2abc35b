"""What ``tomoshadow doctor`` asks of a rig: each device by itself, so that one that is broken hides no other."""

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

from daq.devices import Camera, Device, GeneratorState, Interlock, PulseGenerator
from daq.errors import AlreadyHeld, DaqError, DeviceError
from server.doctor.checkup import Checkup, Status
from server.rig.assembly import wire_rig
from server.rig.config import RigConfig

JUMBO_BYTES = 9000
"""Packets of 1500 bytes cost six times the interrupts."""
_DEADLINE_S = 10.0
_SERIAL_REMEDY = "plug it in; is the port in the configuration the one in /dev/serial/by-id, may this user open it?"


def check_rig(config: RigConfig) -> Iterator[Checkup]:
    """Look at every device of a rig; yields each finding as it is known. The light stays off.

    Parameters
    ----------
    config : RigConfig
        Of a real rig, or of a simulated one, whose far ends then run meanwhile.
    """
    try:
        with wire_rig(config) as wired:
            rig = wired.rig
            for view, camera in rig.cameras.items():
                yield check_network(f"network of {view}", config.views[view].camera.ip, config.network.packet_bytes)
                yield check_camera(camera, config.views[view].camera.ip)
            yield check_generator(rig.generator)
            yield check_interlock(rig.interlock)
            if rig.stage is not None:
                yield _opened(rig.stage, "stage", _SERIAL_REMEDY)
    except AlreadyHeld as error:
        yield Checkup(
            "rig", Status.WARN, str(error), "the lamps of its page tell how it is; looking here would end a run"
        )
    except DaqError as error:
        yield Checkup("rig", Status.FAIL, str(error), "mend what the text names")


def check_network(name: str, ip: str, packet_bytes: int) -> Checkup:
    """Interface that leads to a camera, and whether its packets pass."""
    command = ["ip", "-json", "route", "get", ip]
    try:
        route = subprocess.run(command, capture_output=True, text=True, timeout=_DEADLINE_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return Checkup(name, Status.WARN, f"cannot be asked: {error}", "apt install iproute2")
    if route.returncode:
        remedy = f"give the interface of the camera an address in the network of {ip}"
        return Checkup(name, Status.FAIL, f"no route to {ip}: {route.stderr.strip()}", remedy)
    interface = json.loads(route.stdout)[0]["dev"]
    mtu_bytes = int(Path("/sys/class/net", interface, "mtu").read_text())
    return _packets(name, f"{ip} by {interface}, MTU {mtu_bytes}", interface, mtu_bytes, packet_bytes)


def _packets(name: str, detail: str, interface: str, mtu_bytes: int, packet_bytes: int) -> Checkup:
    widen = f"ip link set {interface} mtu {JUMBO_BYTES}, jumbo frames in the switch"
    if mtu_bytes < packet_bytes:
        problem = f"{detail}: packets of {packet_bytes} bytes do not pass"
        return Checkup(name, Status.FAIL, problem, f"[network] packet_bytes = {mtu_bytes} in the rig file, or {widen}")
    if packet_bytes < JUMBO_BYTES:
        costs = f"{detail}, packets of {packet_bytes} bytes: works, at six times the interrupts"
        return Checkup(name, Status.WARN, costs, f"{widen}, and [network] packet_bytes = {JUMBO_BYTES}")
    return Checkup(name, Status.OK, detail)


def check_camera(camera: Camera, ip: str) -> Checkup:
    """Whether a camera answers at its address and lets itself be opened."""
    return _opened(
        camera, f"camera of {camera.name}", f"is it powered, is its address {ip}, does another program hold it?"
    )


def check_generator(generator: PulseGenerator) -> Checkup:
    """Who the pulse generator is, and whether it is safe."""
    name = "pulse generator"
    try:
        with generator:
            identity, status = generator.identity(), generator.status()
    except DeviceError as error:
        return Checkup(name, Status.FAIL, error.reason, _SERIAL_REMEDY)
    detail = f"{identity.vendor} {identity.model}, firmware {identity.firmware}, {status.state}"
    if status.state is GeneratorState.FAULT or status.faults:
        remedy = "look at the LEDs, then acknowledge; tomoshadow firmware selftest tells more"
        return Checkup(name, Status.FAIL, f"{detail}: {', '.join(status.faults)}", remedy)
    return Checkup(name, Status.OK, detail)


def check_interlock(interlock: Interlock) -> Checkup:
    """Whether the interlock can be read and is closed."""
    try:
        with interlock:
            closed = interlock.is_closed()
    except DeviceError as error:
        remedy = "is the chip in the configuration the one that gpiodetect lists, may this user open it?"
        return Checkup("interlock", Status.FAIL, error.reason, remedy)
    if not closed:
        return Checkup("interlock", Status.WARN, "open: the light is locked", "close door and enclosure")
    return Checkup("interlock", Status.OK, "closed")


def _opened(device: Device, name: str, remedy: str) -> Checkup:
    try:
        with device:
            identity = device.identity()
    except DeviceError as error:
        return Checkup(name, Status.FAIL, error.reason, remedy)
    return Checkup(name, Status.OK, f"{identity.vendor} {identity.model}, {identity.serial}")
