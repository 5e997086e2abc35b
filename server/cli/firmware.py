"""``tomoshadow firmware``: identity, limits, faults, self-test, timing diagram, continuous light, flashing."""

import sys
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

from daq.errors import DeviceError, PlanError
from server.cli.options import Verbs, add_out, add_rig, add_verb
from server.cli.output import Outcome, progress, table, train_table

if TYPE_CHECKING:
    from daq.devices import GeneratorStatus, PulseGenerator
    from daq.drivers.pulse_line import PulseLine
    from daq.drivers.pulse_self_test import Check
    from server.rig.config import RigConfig

_HEARTBEAT_S = 0.5


def add(verbs: Verbs) -> None:
    """Add the tools."""
    tools = verbs.add_parser("firmware", help="the pulse generator").add_subparsers(required=True, metavar="TOOL")
    add_rig(add_verb(tools, "info", info, "identity, state and counters of the pulse generator"))
    add_rig(add_verb(tools, "clear", clear, "acknowledge the latched faults of the pulse generator; nothing is fired"))
    _add_limits_options(add_verb(tools, "limits", limits, "limits of the LEDs, in the board and in the rig file"))
    summary = "try everything that needs no light: protocol, refusals, limits, budget, off"
    _add_selftest_options(add_verb(tools, "selftest", selftest, summary))
    summary = "timing diagram of a pulse train as the generator loads it; nothing is fired"
    _add_scope_options(add_verb(tools, "scope", scope, summary))
    summary = "continuous light of low current, as the back light of the calibration target; Ctrl-C ends it"
    _add_light_options(add_verb(tools, "light", light, summary))
    summary = "check a UF2 image and copy it to a board that waits for one"
    _add_flash_options(add_verb(tools, "flash", flash, summary))


def _add_limits_options(parser: ArgumentParser) -> None:
    add_rig(parser)
    parser.add_argument("--store", action="store_true", help="make those of the rig file the board's")


def _add_selftest_options(parser: ArgumentParser) -> None:
    add_rig(parser)
    parser.add_argument("--light", action="store_true", help="then, with somebody at an oscilloscope, what needs light")


def _add_scope_options(parser: ArgumentParser) -> None:
    add_rig(parser)
    add_out(parser, "SVG and PNG of this name; default timing.svg", default=Path("timing.svg"))
    parser.add_argument("--plan", type=Path, metavar="PLAN.json", help="run plan; default: nominal currents")
    parser.add_argument("--width", type=int, metavar="NS", help="pulse width of the default plan")
    parser.add_argument("--separation", type=int, metavar="NS", help="pulse separation of the default plan")


def _add_light_options(parser: ArgumentParser) -> None:
    add_rig(parser)
    parser.add_argument("--current-a", type=float, required=True, help="current of each LED, at most its max_light_a")
    parser.add_argument("--time-s", type=float, default=60.0, help="it ends by itself; at most 600, default 60")
    parser.add_argument(
        "--view", action="append", metavar="VIEW", help="LED of this view; default: all with max_light_a"
    )


def _add_flash_options(parser: ArgumentParser) -> None:
    parser.add_argument("image", type=Path, metavar="IMAGE.uf2")
    parser.add_argument("--drive", type=Path, help="where RPI-RP2 is mounted; default: the only one found")


def info(options: Namespace) -> Outcome:
    """Ask the generator for all that it tells."""
    from daq.drivers.pulse_protocol import CHANNEL_COUNT, COUNTERS, Cause, Command, Fault, State
    from server.rig.assembly import open_pulse_line
    from server.rig.config import load_config

    with open_pulse_line(load_config(options.config)) as (line, identity):
        status = line.ask(Command.STATUS)
        faults = Fault(status.number("faults"))
        result = {
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
    return Outcome(result, described(result))


def clear(options: Namespace) -> Outcome:
    """Acknowledge the latched faults; the generator refuses while their cause lasts, and arms nothing."""
    from server.rig.assembly import open_generator
    from server.rig.config import load_config

    config = load_config(options.config)
    if config.simulation is not None:
        raise PlanError(
            f"{options.config}: the rig is simulated, and this command would get a generator of its own: "
            "acknowledge them on the page of the server that shows them"
        )
    with open_generator(config) as generator:
        latched = sorted(fault.upper() for fault in generator.status().faults)
        progress(f"latched: {', '.join(latched) or 'no fault'}")
        if latched:
            generator.clear()
        status = generator.status()
    left = sorted(fault.upper() for fault in status.faults)
    result = {"acknowledged": latched, "state": status.state.name, "faults": left}
    return Outcome(result, f"state: {status.state.name}, faults: {', '.join(left) or 'none'}")


def _limits(line: "PulseLine", channel: int) -> Iterator[tuple[str, int]]:
    from daq.drivers.pulse_protocol import FIELDS, UNCHANGED, Command

    reply = line.ask(Command.LIMIT, channel, UNCHANGED, UNCHANGED, UNCHANGED)
    for name in FIELDS[Command.LIMIT].reply:
        yield name, reply.number(name)


def described(result: dict[str, Any]) -> str:
    """Identity, state, counters and limits, for people."""
    lines = [
        f"identity: {_named(result['identity'])}",
        f"starts: {result['starts']}, the last one by {result['start_cause']}",
        f"state: {result['state']}, faults: {', '.join(result['faults']) or 'none'}",
        f"interlock: {_closed(result['interlock_closed'])}, emergency stop: {_closed(result['estop_closed'])}",
        f"shots left: {result['shots_left']}",
        f"counters: {_named(result['counters'])}",
    ]
    limits = result["limits"]
    return "\n".join([*lines, table(list(limits[0]), [[str(value) for value in limit.values()] for limit in limits])])


def _named(values: dict[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in values.items())


def _closed(closed: bool) -> str:
    return "closed" if closed else "open"


def limits(options: Namespace) -> Outcome:
    """Compare the limits that the board keeps with those of the rig file; with --store, make them the board's."""
    from daq.drivers.pulse_limits import NAMES, kept_limits, store_limits
    from daq.drivers.pulse_protocol import CHANNEL_COUNT
    from server.rig.assembly import open_pulse_line
    from server.rig.config import load_config

    config = load_config(options.config)
    wanted = [_limits_of_rig(config, channel) for channel in range(CHANNEL_COUNT)]
    with open_pulse_line(config) as (line, _):
        if options.store:
            store_limits(line, wanted)
        stored, kept = kept_limits(line)
    rows = [[str(i), *map(str, (*kept[i], *wanted[i]))] for i in range(CHANNEL_COUNT)]
    heads = ["channel", *(f"{owner}: {name}" for owner in ("board", "rig") for name in NAMES)]
    text = f"{_STORED_TEXT[stored.name]}\n{table(heads, rows)}"
    return Outcome({"stored": stored.name, "board": kept, "rig": wanted}, text)


_STORED_TEXT = {
    "NONE": "the board keeps no limits of its own: the absolute ones count (firmware limits --store)",
    "WHOLE": "the board keeps limits of its own",
    "DAMAGED": "the limits in the board are damaged: no light until they are stored again (firmware limits --store)",
}


def _limits_of_rig(config: "RigConfig", channel: int) -> tuple[int, int, int]:
    """A channel without a view has no LED, and gets no light."""
    from daq.drivers.pulse_protocol import MAX_DUTY_PPM

    for view in config.views.values():
        if view.led_channel == channel:
            return round(view.max_current_a * 1000), MAX_DUTY_PPM, round(view.max_light_a * 1000)
    return 0, 0, 0


def selftest(options: Namespace) -> Outcome:
    """Let the generator prove itself; no LED is lit before somebody has said so."""
    from daq.drivers.pulse_self_test import Verdict
    from server.rig.config import load_config

    config = load_config(options.config)
    checks = []
    for check in _checks(config, light=options.light):
        progress(f"{check.verdict:8}{check.name}: {check.detail}")
        checks.append(check)
    found = Counter(check.verdict for check in checks)
    result = {"passed": not found[Verdict.FAIL], "checks": [asdict(check) for check in checks]}
    return Outcome(result, ", ".join(f"{found[verdict]} {verdict}" for verdict in Verdict))


def _checks(config: "RigConfig", *, light: bool) -> "Iterator[Check]":
    from daq.drivers.pulse_light_test import light_test
    from daq.drivers.pulse_self_test import self_test
    from daq.timing import plan_shot_timing
    from server.rig.assembly import open_generator, open_pulse_line
    from server.rig.shot_timing import camera_timings, nominal_plan

    with open_pulse_line(config) as (line, identity):
        yield from self_test(line, identity)
    if light:
        timing = plan_shot_timing(nominal_plan(config), camera_timings(config))
        with open_generator(config) as generator:
            yield from light_test(generator, timing, _Terminal())


class _Terminal:
    """Somebody who reads and types: light follows an empty line, and no other answer."""

    def ready(self, task: str) -> bool:
        return not self._asked(f"{task}. Enter: ready; s: leave it out")

    def confirms(self, question: str) -> bool:
        return self._asked(f"{question} y or n").startswith("y")

    @staticmethod
    def _asked(question: str) -> str:
        progress(question)
        if answer := sys.stdin.readline():
            return answer.strip().lower()
        raise PlanError("nobody answers, standard input has ended: light is fired only where somebody looks")


def scope(options: Namespace) -> Outcome:
    """Draw the train; it is loaded and never armed, so there is no light."""
    from daq.timing import plan_shot_timing
    from processing.runs.overwriting import require_free
    from server.pictures.timing_diagram import picture, timing_diagram
    from server.rig.assembly import open_generator
    from server.rig.config import load_config
    from server.rig.shot_timing import camera_timings, fired_timing, load_plan, nominal_plan, timing_table

    files = {kind: options.out.with_suffix(f".{kind}") for kind in ("svg", "png")}
    require_free(*files.values(), overwrite=options.overwrite)
    config = load_config(options.config)
    plan = load_plan(options.plan) if options.plan else nominal_plan(config, options.width, options.separation)
    cameras = camera_timings(config)
    requested = plan_shot_timing(plan, cameras)
    with open_generator(config) as generator:
        identity = generator.identity()
        actual = fired_timing(requested, cameras, generator.configure(requested))
    figure = timing_diagram(actual, f"{config.name}: pulse train as loaded, {identity.model} {identity.firmware}")
    options.out.parent.mkdir(parents=True, exist_ok=True)
    files["svg"].write_bytes(picture(figure, "svg"))
    files["png"].write_bytes(picture(figure, "png"))
    views = timing_table(requested, actual)
    saved = {kind: str(path) for kind, path in files.items()}
    result = {**saved, "shortest_period_ns": requested.shortest_period_ns, "views": views}
    return Outcome(result, f"{train_table(views)}\n{saved['svg']}, {saved['png']}")


def light(options: Namespace) -> Outcome:
    """Light until the time is over, or Ctrl-C; whatever ends it, the generator is off then."""
    from server.rig.assembly import open_generator
    from server.rig.config import load_config

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
    result = {"views": views, "current_a": options.current_a, "time_s": options.time_s}
    return Outcome(result, f"{', '.join(views)}: off")


def _wait_while_lit(generator: "PulseGenerator") -> "GeneratorStatus":
    """Asking is the heartbeat without which the light ends."""
    from daq.devices import GeneratorState

    never = Event()
    while (status := generator.status()).state is GeneratorState.LIT:
        never.wait(_HEARTBEAT_S)
    return status


def flash(options: Namespace) -> Outcome:
    """Flash; nothing is written before image and board have been checked."""
    from server.rig.firmware_image import find_drive, load_image, write_image

    image = load_image(options.image)
    drive = find_drive(options.drive)
    progress(f"{image.path}: version {image.version}, {image.blocks} blocks, to {drive}")
    result = {"written": str(write_image(image, drive)), "version": image.version, "blocks": image.blocks}
    return Outcome(result, f"{result['written']}: version {image.version}")
