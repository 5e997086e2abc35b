"""What ``tomoshadow firmware`` does: identity and limits, self-test, timing diagram, continuous light, flashing."""

import threading
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from daq.devices import GeneratorState, GeneratorStatus, PulseGenerator
from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_protocol import CHANNEL_COUNT, COUNTERS, FIELDS, UNCHANGED, Cause, Command, Fault, State
from daq.drivers.pulse_self_test import Verdict, self_test
from daq.errors import DeviceError, PlanError
from daq.timing import plan_shot_timing
from server.cli.commands import progress
from server.pictures.timing_diagram import picture, timing_diagram
from server.rig.assembly import open_generator, open_pulse_line
from server.rig.config import load_config
from server.rig.firmware_image import find_drive, load_image, write_image
from server.rig.shot_timing import camera_timings, fired_timing, load_plan, nominal_plan, timing_table

_HEARTBEAT_S = 0.5


def info(options: Namespace) -> dict[str, Any]:
    """``tomoshadow firmware info``."""
    with open_pulse_line(load_config(options.config)) as (line, identity):
        status = line.ask(Command.STATUS)
        faults = Fault(status.number("faults"))
        return {
            "identity": dict(identity.fields),
            "starts": identity.boot,
            "start_cause": Cause(identity.number("cause")).name,
            "state": State(status.number("state")).name,
            "faults": [fault.name for fault in Fault if fault & faults],
            "interlock_closed": status.number("interlock") == 1,
            "estop_closed": status.number("estop") == 1,
            "shots_left": status.number("shots_left"),
            "counters": {name: status.number(name) for name in COUNTERS},
            "limits": [dict(_limits(line, channel)) for channel in range(CHANNEL_COUNT)],
        }


def _limits(line: PulseLine, channel: int) -> Iterator[tuple[str, int]]:
    reply = line.ask(Command.LIMIT, channel, UNCHANGED, UNCHANGED, UNCHANGED)
    for name in FIELDS[Command.LIMIT].reply:
        yield name, reply.number(name)


def selftest(options: Namespace) -> dict[str, Any]:
    """``tomoshadow firmware selftest``; no LED is lit."""
    checks = []
    with open_pulse_line(load_config(options.config)) as (line, identity):
        for check in self_test(line, identity):
            progress(f"{check.verdict:8}{check.name}: {check.detail}")
            checks.append(check)
    return {
        "passed": all(check.verdict is not Verdict.FAIL for check in checks),
        "checks": [asdict(check) for check in checks],
    }


def scope(options: Namespace) -> dict[str, Any]:
    """``tomoshadow firmware scope``; the train is loaded and never armed, so there is no light."""
    config = load_config(options.config)
    plan = load_plan(options.plan) if options.plan else nominal_plan(config, options.width, options.separation)
    cameras = camera_timings(config)
    requested = plan_shot_timing(plan, cameras)
    with open_generator(config) as generator:
        identity = generator.identity()
        actual = fired_timing(requested, cameras, generator.configure(requested))
    figure = timing_diagram(actual, f"{config.name}: pulse train as loaded, {identity.model} {identity.firmware}")
    files = {kind: options.out.with_suffix(f".{kind}") for kind in ("svg", "png")}
    options.out.parent.mkdir(parents=True, exist_ok=True)
    files["svg"].write_bytes(picture(figure, "svg"))
    files["png"].write_bytes(picture(figure, "png"))
    return {
        **{kind: str(path) for kind, path in files.items()},
        "shortest_period_ns": requested.shortest_period_ns,
        "views": timing_table(requested, actual),
    }


def light(options: Namespace) -> dict[str, Any]:
    """``tomoshadow firmware light``: until its time is over, or Ctrl-C; whatever ends it, the generator is off then."""
    config = load_config(options.config)
    views = options.view or [name for name, view in config.views.items() if view.max_light_a]
    if not views:
        raise PlanError(f"{options.config}: no view permits continuous light, none has max_light_a")
    with open_generator(config) as generator:
        generator.light(dict.fromkeys(views, options.current_a), options.time_s)
        progress(f"{', '.join(views)}: lit for {options.time_s:g} s at most; Ctrl-C ends it")
        status = _wait_while_lit(generator)
    if status.faults:
        raise DeviceError(generator.name, f"the light was ended by a fault: {', '.join(status.faults)}")
    return {"views": views, "current_a": options.current_a, "time_s": options.time_s}


def _wait_while_lit(generator: PulseGenerator) -> GeneratorStatus:
    """Asking is the heartbeat without which the light ends."""
    never = threading.Event()
    while (status := generator.status()).state is GeneratorState.LIT:
        never.wait(_HEARTBEAT_S)
    return status


def flash(options: Namespace) -> dict[str, Any]:
    """``tomoshadow firmware flash``; nothing is written before image and board have been checked."""
    image = load_image(options.image)
    drive = find_drive(options.drive)
    progress(f"{image.path}: version {image.version}, {image.blocks} blocks, to {drive}")
    return {"written": str(write_image(image, drive)), "version": image.version, "blocks": image.blocks}
