"""Options of the commands below ``tomoshadow firmware``."""

import argparse
from collections.abc import Callable
from pathlib import Path

from server.cli import firmware_commands


def add_firmware_tools(verb: Callable[..., argparse.ArgumentParser]) -> None:
    """Add one parser per tool; ``verb`` takes name, command and summary."""
    _add_config(verb("info", firmware_commands.info, "identity, state and counters of the pulse generator"))
    summary = "try everything that needs no light: protocol, refusals, limits, budget, off"
    _add_config(verb("selftest", firmware_commands.selftest, summary))
    summary = "timing diagram of a pulse train as the generator loads it; nothing is fired"
    _add_scope_options(verb("scope", firmware_commands.scope, summary))
    summary = "continuous light of low current, as the back light of the calibration target; Ctrl-C ends it"
    _add_light_options(verb("light", firmware_commands.light, summary))
    summary = "check a UF2 image and copy it to a board that waits for one"
    _add_flash_options(verb("flash", firmware_commands.flash, summary))


def _add_config(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", type=Path, required=True, help="rig configuration")


def _add_scope_options(parser: argparse.ArgumentParser) -> None:
    _add_config(parser)
    parser.add_argument("-o", "--out", type=Path, default=Path("timing.svg"), help="SVG and PNG of this name")
    parser.add_argument("--plan", type=Path, metavar="PLAN.json", help="run plan; default: nominal currents")
    parser.add_argument("--width", type=int, metavar="NS", help="pulse width of the default plan")
    parser.add_argument("--separation", type=int, metavar="NS", help="pulse separation of the default plan")


def _add_light_options(parser: argparse.ArgumentParser) -> None:
    _add_config(parser)
    parser.add_argument("--current-a", type=float, required=True, help="current of each LED, at most its max_light_a")
    parser.add_argument("--time-s", type=float, default=60.0, help="it ends by itself; at most 600, default 60")
    parser.add_argument(
        "--view", action="append", metavar="VIEW", help="LED of this view; default: all with max_light_a"
    )


def _add_flash_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("image", type=Path, metavar="IMAGE.uf2")
    parser.add_argument("--drive", type=Path, help="where RPI-RP2 is mounted; default: the only one found")
