"""The circuit of docs/firmware/wiring.md and parts.md: the table of its parts, and the net of every pin."""

from collections.abc import Iterator
from dataclasses import dataclass

CHANNELS = 4
OPEN = ""
"""A pin that is left open on purpose."""


@dataclass(frozen=True)
class Pin:
    """Number and name on the part, what it does, and its net."""

    number: str
    name: str
    kind: str
    net: str


@dataclass(frozen=True)
class Part:
    """One part of the circuit."""

    reference: str
    value: str
    pins: tuple[Pin, ...]


def _part(reference: str, value: str, *pins: tuple[str, str, str, str]) -> Part:
    return Part(reference, value, tuple(Pin(*pin) for pin in pins))


def _two(reference: str, value: str, first: str, second: str) -> Part:
    return _part(reference, value, ("1", "1", "passive", first), ("2", "2", "passive", second))


def _pico() -> Part:
    signals = [
        ("1", "GP0", "output", "UART_TX"),
        ("2", "GP1", "input", "UART_RX"),
        *((str((4, 5, 6, 7)[i]), f"GP{2 + i}", "output", f"LIGHT_{i}") for i in range(CHANNELS)),
        *((str(9 + i), f"GP{6 + i}", "output", f"CAMERA_{i}") for i in range(CHANNELS)),
        ("15", "GP11", "input", "TRIGGER"),
        ("16", "GP12", "input", "INTERLOCK"),
        ("17", "GP13", "input", "ESTOP"),
        *((number, f"GP{16 + i}", "output", OPEN) for i, number in enumerate(("21", "22", "24", "25"))),
        ("26", "GP20", "bidirectional", "I2C_SDA"),
        ("27", "GP21", "bidirectional", "I2C_SCL"),
        ("30", "RUN", "input", "RUN"),
        ("36", "3V3", "power_out", "+3V3"),
        ("39", "VSYS", "power_in", "+5V"),
    ]
    grounds = ((number, "GND", "power_in", "GND") for number in ("3", "8", "13", "18", "23", "28", "33", "38"))
    return _part("U1", "Raspberry Pi Pico", *signals, *grounds)


def _converter() -> Iterator[Part]:
    outputs = ((str(6 + i), f"VOUT{'ABCD'[i]}", "output", f"SET_POINT_{i}") for i in range(CHANNELS))
    yield _part(
        "U2",
        "MCP4728",
        ("1", "VDD", "power_in", "+3V3"),
        ("2", "SCL", "input", "I2C_SCL"),
        ("3", "SDA", "bidirectional", "I2C_SDA"),
        ("4", "LDAC", "input", "GND"),
        ("5", "RDY", "output", OPEN),
        *outputs,
        ("10", "VSS", "power_in", "GND"),
    )
    yield _two("R1", "2.2k", "+3V3", "I2C_SDA")
    yield _two("R2", "2.2k", "+3V3", "I2C_SCL")
    yield _two("C1", "100n", "+3V3", "GND")
    pins = ((str(i + 1), f"SET_{i}", "passive", f"SET_POINT_{i}") for i in range(CHANNELS))
    yield _part("J1", "set-points of the LED drivers", *pins, ("5", "GND", "passive", "GND"))


def _supply() -> Iterator[Part]:
    yield _part(
        "U3",
        "TPS3839G33",
        ("1", "GND", "power_in", "GND"),
        ("2", "RESET", "output", "SUPERVISED"),
        ("3", "VDD", "power_in", "+3V3"),
    )
    yield _two("R3", "1k", "SUPERVISED", "RUN")
    yield _part(
        "J2",
        "supply",
        ("1", "24V", "power_out", "+24V"),
        ("2", "12V", "power_out", "+12V"),
        ("3", "5V", "power_out", "+5V"),
        ("4", "GND", "power_out", "GND"),
    )


def _interlock() -> Iterator[Part]:
    yield _part(
        "K1",
        "safety relay of doors, key and emergency stop",
        ("13", "NO", "passive", "+3V3"),
        ("14", "NO", "passive", "CHAIN"),
        ("23", "NO", "passive", "+24V"),
        ("24", "NO", "passive", "CONTACTOR"),
    )
    poles = (
        (str(2 * i + end), f"POLE{i}", "passive", f"{side}_{i}")
        for i in range(CHANNELS)
        for end, side in ((1, "FUSED"), (2, "SWITCHED"))
    )
    yield _part("K2", "contactor", ("A1", "COIL", "passive", "CONTACTOR"), ("A2", "COIL", "passive", "GND"), *poles)
    yield _two("D1", "diode of the coil", "GND", "CONTACTOR")
    yield _two("S1", "emergency stop, second contact", "+3V3", "ESTOP_CONTACT")
    for number, (contact, net) in enumerate((("CHAIN", "INTERLOCK"), ("ESTOP_CONTACT", "ESTOP"))):
        yield _two(f"R{4 + 2 * number}", "1k", contact, net)
        yield _two(f"R{5 + 2 * number}", "10k", net, "GND")
        yield _two(f"C{2 + number}", "47p", net, "GND")


def _isolators() -> Iterator[Part]:
    yield _part(
        "U4",
        "ISO7721",
        ("1", "VCC1", "power_in", "+3V3"),
        ("2", "OUTA", "output", "UART_RX"),
        ("3", "INB", "input", "UART_TX"),
        ("4", "GND1", "power_in", "GND"),
        ("5", "GND2", "power_in", "HOST_GND"),
        ("6", "OUTB", "output", "HOST_RX"),
        ("7", "INA", "input", "HOST_TX"),
        ("8", "VCC2", "power_in", "HOST_3V3"),
    )
    yield _part(
        "J3",
        "serial line of the host",
        ("1", "3V3", "power_out", "HOST_3V3"),
        ("2", "RX", "passive", "HOST_RX"),
        ("3", "TX", "passive", "HOST_TX"),
        ("4", "GND", "power_out", "HOST_GND"),
    )
    yield _part(
        "U5",
        "ISO7710F",
        ("1", "VCC1", "power_in", "OUTSIDE_3V3"),
        ("2", "IN", "input", "OUTSIDE_TRIGGER"),
        ("3", "VCC1", "power_in", "OUTSIDE_3V3"),
        ("4", "GND1", "power_in", "OUTSIDE_GND"),
        ("5", "GND2", "power_in", "GND"),
        ("6", "OUT", "output", "TRIGGER"),
        ("7", "NC", "passive", OPEN),
        ("8", "VCC2", "power_in", "+3V3"),
    )
    yield _part(
        "J4",
        "external trigger",
        ("1", "3V3", "power_out", "OUTSIDE_3V3"),
        ("2", "TRIGGER", "passive", "OUTSIDE_TRIGGER"),
        ("3", "GND", "power_out", "OUTSIDE_GND"),
    )


def _cameras() -> Iterator[Part]:
    buffers = (((1, 2, 3), 0), ((4, 5, 6), 1), ((10, 9, 8), 2), ((13, 12, 11), 3))
    pins = (
        pin
        for (enable, a, y), i in buffers
        for pin in (
            (str(enable), f"OE{i}", "input", "GND"),
            (str(a), f"A{i}", "input", f"CAMERA_{i}"),
            (str(y), f"Y{i}", "output", f"CAMERA_5V_{i}"),
        )
    )
    yield _part("U6", "74HCT125", *pins, ("7", "GND", "power_in", "GND"), ("14", "VCC", "power_in", "+5V"))
    sockets = ((str(i + 1), f"CAMERA_{i}", "passive", f"CAMERA_5V_{i}") for i in range(CHANNELS))
    yield _part("J5", "trigger inputs of the cameras", *sockets, ("5", "GND", "passive", "GND"))
    for i in range(CHANNELS):
        yield _two(f"R{10 + i}", "10k", f"CAMERA_{i}", "GND")


def _channel(i: int) -> Iterator[Part]:
    """Light line to LED: gate, one-shot that can only shorten, driver, switch, and the limit of the energy."""
    first = 100 * (i + 1)
    yield _two(f"R{first}", "10k", f"LIGHT_{i}", "GND")
    yield _part(
        f"U{first}",
        "74LVC1G08",
        ("1", "B", "input", "INTERLOCK"),
        ("2", "A", "input", f"LIGHT_{i}"),
        ("3", "GND", "power_in", "GND"),
        ("4", "Y", "output", f"GATED_{i}"),
        ("5", "VCC", "power_in", "+3V3"),
    )
    yield _part(
        f"U{first + 1}",
        "74LVC1G123",
        ("1", "A", "input", "GND"),
        ("2", "B", "input", "+3V3"),
        ("3", "CLR", "input", f"GATED_{i}"),
        ("4", "GND", "power_in", "GND"),
        ("5", "Q", "output", f"SHORTENED_{i}"),
        ("6", "CX", "passive", f"CX_{i}"),
        ("7", "RCX", "passive", f"RCX_{i}"),
        ("8", "VCC", "power_in", "+3V3"),
    )
    yield _two(f"R{first + 1}", "2.5 us with C", "+3V3", f"RCX_{i}")
    yield _two(f"C{first}", "2.5 us with R", f"CX_{i}", f"RCX_{i}")
    yield _part(
        f"U{first + 2}",
        "UCC27517A",
        ("1", "VDD", "power_in", "+12V"),
        ("2", "GND", "power_in", "GND"),
        ("3", "IN+", "input", f"SHORTENED_{i}"),
        ("4", "IN-", "input", "GND"),
        ("5", "OUT", "output", f"GATE_{i}"),
    )
    yield _two(f"R{first + 2}", "10k", f"SHORTENED_{i}", "GND")
    yield _two(f"R{first + 7}", "10k", f"GATE_{i}", f"SHUNT_{i}")
    yield _part(
        f"Q{first}",
        "MOSFET 60 V, 10 mOhm",
        ("G", "G", "input", f"GATE_{i}"),
        ("D", "D", "passive", f"CATHODE_{i}"),
        ("S", "S", "passive", f"SHUNT_{i}"),
    )
    yield _two(f"R{first + 3}", "shunt 10m", f"SHUNT_{i}", "GND")
    yield _two(f"R{first + 6}", "limit 0.9, pulses", f"BANK_{i}", f"ANODE_{i}")
    yield _two(f"D{first}", "LED", f"ANODE_{i}", f"CATHODE_{i}")
    yield _two(f"F{first}", "fuse, slow", "+24V", f"FUSED_{i}")
    yield _two(f"R{first + 4}", "charge 100, 10 W", f"SWITCHED_{i}", f"BANK_{i}")
    yield _two(f"C{first + 1}", "470u", f"BANK_{i}", "GND")
    yield _two(f"C{first + 2}", "10u, ceramic", f"BANK_{i}", "GND")
    yield _two(f"R{first + 5}", "bleeder 47k", f"BANK_{i}", "GND")


def parts() -> tuple[Part, ...]:
    """All of them."""
    channels = (part for i in range(CHANNELS) for part in _channel(i))
    return (_pico(), *_converter(), *_supply(), *_interlock(), *_isolators(), *_cameras(), *channels)
