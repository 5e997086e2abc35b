"""The limits that a board keeps for its LEDs, against those of a rig file."""

from collections.abc import Mapping

from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_protocol import Command, Stored
from daq.errors import DeviceRefused


def check_stored_limits(
    line: PulseLine, channels: Mapping[str, int], max_current_a: Mapping[str, float], max_light_a: Mapping[str, float]
) -> None:
    """Refuse a rig file that permits more than the board keeps, which is the word of whoever mounted the LEDs.

    Damaged limits permit no light, and the status names them: nothing is refused here.

    Raises
    ------
    DeviceRefused
        With both figures.
    """
    for view in sorted(max_current_a.keys() | max_light_a.keys()):
        stored = line.ask(Command.STORED, channels[view])
        for name, limits_a in (("max_current", max_current_a), ("max_light", max_light_a)):
            rig_a, board_ma = limits_a.get(view, 0.0), stored.number(f"{name}_ma")
            if stored.number("stored") == Stored.WHOLE and round(rig_a * 1000) > board_ma:
                raise DeviceRefused(
                    line.name,
                    f"the rig file permits {name}_a {rig_a:g} A for {view}, the board keeps {board_ma / 1000:g} A for "
                    f"channel {channels[view]}: correct the rig file, or, if this LED takes it, store its limits in "
                    "the board (tomoshadow firmware limits --store)",
                )
