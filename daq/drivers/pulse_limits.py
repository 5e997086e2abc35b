"""The limits that a board keeps for its LEDs: what they are, made those of a rig file, and compared with them."""

from collections.abc import Mapping, Sequence

from daq.drivers.pulse_line import PulseLine
from daq.drivers.pulse_protocol import CHANNEL_COUNT, ERROR_TEXT, UNCHANGED, Command, ErrorNumber, Stored
from daq.errors import DeviceRefused, ProtocolError

NAMES = ("max_current_ma", "max_duty_ppm", "max_light_ma")
Limits = tuple[int, ...]
"""Of one LED, in the order of NAMES."""


def kept_limits(line: PulseLine) -> tuple[Stored, list[Limits]]:
    """Whether the board keeps any, and those of each channel."""
    replies = [line.ask(Command.STORED, channel) for channel in range(CHANNEL_COUNT)]
    return Stored(replies[0].number("stored")), [tuple(map(reply.number, NAMES)) for reply in replies]


def store_limits(line: PulseLine, wanted: Sequence[Limits]) -> None:
    """Make these the board's, unless they are already: it has room for 64 times.

    Raises
    ------
    DeviceRefused
        It does not take them; with what helps.
    """
    if kept_limits(line) == (Stored.WHOLE, list(wanted)):
        return
    error = line.answer(Command.STORE, *(value for channel in wanted for value in channel)).error
    if error is ErrorNumber.HARDWARE:
        raise DeviceRefused(
            line.name,
            "the board does not keep these limits: it was told others 64 times, or its flash does not answer. Hold "
            "BOOTSEL, copy erase-limits.uf2 to the board, and store them again",
        )
    if error is not None:
        raise DeviceRefused(line.name, f"{Command.STORE} refused: {ERROR_TEXT[error]} (error {error.value})")


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


def tighten_limits(
    line: PulseLine, channels: Mapping[str, int], max_current_a: Mapping[str, float], max_light_a: Mapping[str, float]
) -> None:
    """Before every train: a generator that was reset has forgotten its limits, and every train with them."""
    for view in sorted(max_current_a.keys() | max_light_a.keys()):
        pulse_ma, light_ma = _limit_ma(max_current_a, view), _limit_ma(max_light_a, view)
        reply = line.ask(Command.LIMIT, channels[view], pulse_ma, UNCHANGED, light_ma)
        for name, limit_ma in (("max_current_ma", pulse_ma), ("max_light_ma", light_ma)):
            if reply.number(name) > limit_ma:
                raise ProtocolError(line.name, f"keeps {reply.number(name)} mA as {name} of {view}")


def _limit_ma(limits_a: Mapping[str, float], view: str) -> int:
    return round(limits_a[view] * 1000) if view in limits_a else UNCHANGED
