"""The schematic, read as KiCad does, by the places of pins and labels: its pins are the firmware's, and it is sound.

KiCad's own check of electrical rules has a command line since version 8, Debian 13's; the rules that matter are checked
here, wherever.
"""

import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HARDWARE = ROOT / "firmware" / "hardware"
SCHEMATIC = HARDWARE / "pulse_generator.kicad_sch"
GPIO_OF_BOARD_PIN = {
    pin: gpio
    for gpio, pin in enumerate(
        (1, 2, 4, 5, 6, 7, 9, 10, 11, 12, 14, 15, 16, 17, 19, 20, 21, 22, 24, 25, 26, 27, 29, *[0] * 3, 31, 32, 34)
    )
    if pin
}
"""Of the Raspberry Pi Pico, from its data sheet."""
PINS_ELSEWHERE = {
    "MCP4728": "VDD SCL SDA LDAC RDY VOUTA VOUTB VOUTC VOUTD VSS",
    "TPS3839G33": "GND RESET VDD",
    "74LVC1G08": "in in GND out VCC",
    "74LVC1G123": "A B CLR GND Q CX RCX VCC",
    "74HCT125": "OE0 A0 Y0 OE1 A1 Y1 GND Y2 A2 OE2 Y3 A3 OE3 VCC",
}
"""Pins 1, 2, 3... of parts, typed from the symbol library of KiCad 6.0.10, whose makers read the data sheets: MCP4728,
TPS3839DBZ (in its other package the pins are others), 74LVC1G08, 74LVC1G123, 74LS125."""
NETS = {
    "PIN_UART_TX": ["UART_TX"],
    "PIN_UART_RX": ["UART_RX"],
    "PIN_LIGHT": [f"LIGHT_{i}" for i in range(4)],
    "PIN_CAMERA": [f"CAMERA_{i}" for i in range(4)],
    "PIN_TRIGGER": ["TRIGGER"],
    "PIN_INTERLOCK": ["INTERLOCK"],
    "PIN_ESTOP": ["ESTOP"],
    "PIN_SET_POINT": [],  # PWM is for a board without the converter
    "PIN_I2C_SDA": ["I2C_SDA"],
    "PIN_I2C_SCL": ["I2C_SCL"],
}
Tree = list["Tree | str"]


def tree(text: str) -> Tree:
    """S-expressions as lists."""
    levels: list[Tree] = [[]]
    for quoted, bracket, word in re.findall(r'"([^"]*)"|([()])|([^\s()"]+)', text):
        if bracket == "(":
            levels.append([])
        elif bracket == ")":
            done = levels.pop()
            levels[-1].append(done)
        else:
            levels[-1].append(word or quoted)
    (only,) = levels[0]
    assert isinstance(only, list)
    return only


def children(node: Tree, name: str) -> Iterator[Tree]:
    for child in node:
        if isinstance(child, list) and child and child[0] == name:
            yield child


def at(node: Tree) -> tuple[float, float]:
    _, x, y, *_ = next(children(node, "at"))
    return round(float(str(x)), 2), round(float(str(y)), 2)


@dataclass(frozen=True)
class Pin:
    part: str
    value: str
    number: str
    name: str
    kind: str


def circuit(file: Path) -> tuple[dict[str, list[Pin]], list[Pin]]:
    """Pins by net, and those that are open on purpose; a pin is what a label at its end says."""
    sheet = tree(file.read_text())
    labels = {at(label): str(label[1]) for label in children(sheet, "global_label")}
    unconnected = {at(mark) for mark in children(sheet, "no_connect")}
    (library,) = children(sheet, "lib_symbols")
    shapes = {str(symbol[1]): symbol for symbol in children(library, "symbol")}
    nets: dict[str, list[Pin]] = defaultdict(list)
    open_pins, seen = [], set()
    for placed in children(sheet, "symbol"):
        shape = shapes[str(next(children(placed, "lib_id"))[1])]
        values = {str(each[1]): str(each[2]) for each in children(placed, "property")}
        x, y = at(placed)
        for unit in children(shape, "symbol"):
            for drawn in children(unit, "pin"):
                dx, dy = at(drawn)
                place = round(x + dx, 2), round(y - dy, 2)
                assert place not in seen, f"two pins at {place}"
                seen.add(place)
                number, name = (str(next(children(drawn, each))[1]) for each in ("number", "name"))
                pin = Pin(values["Reference"], values["Value"], number, name, str(drawn[1]))
                if place in unconnected:
                    open_pins.append(pin)
                else:
                    nets[labels[place]].append(pin)
    assert seen == set(labels) | unconnected, "labels that are at no pin"
    return nets, open_pins


NETLIST, OPEN = circuit(SCHEMATIC)
NET_OF = {(pin.part, pin.number): net for net, pins in NETLIST.items() for pin in pins}


def one(value: str, net: str) -> str:
    """The part of this value at a net."""
    (reference,) = {pin.part for pin in NETLIST[net] if pin.value == value}
    return reference


def nets_of(reference: str) -> dict[str, str]:
    return {number: net for (part, number), net in NET_OF.items() if part == reference}


def test_the_file_is_made_of_its_table(tmp_path: Path) -> None:
    subprocess.run([sys.executable, HARDWARE / "schematic.py", tmp_path / "made.kicad_sch"], check=True)
    assert (tmp_path / "made.kicad_sch").read_bytes() == SCHEMATIC.read_bytes()


def test_the_pins_are_those_of_the_firmware() -> None:
    pins_h = {
        name: int(gpio)
        for name, gpio in re.findall(r"(PIN_\w+) = (\d+)", (ROOT / "firmware/rp2040/pins.h").read_text())
    }
    assert set(pins_h) == set(NETS)
    drawn = {
        GPIO_OF_BOARD_PIN[int(number)]: net for number, net in nets_of("U1").items() if int(number) in GPIO_OF_BOARD_PIN
    }
    assert drawn == {pins_h[name] + i: net for name, nets in NETS.items() for i, net in enumerate(nets)}


def test_the_pins_are_those_of_the_wiring_guide() -> None:
    guide = (ROOT / "docs/firmware/wiring.md").read_text()
    rows = re.findall(r"^\| (PIN_\w+) \| \d+(?: to \d+)? \| ([\d, ]+) \|", guide, re.MULTILINE)
    told: dict[str, str] = {}
    for name, pins in rows:
        told |= dict(zip(re.findall(r"\d+", pins), NETS[name], strict=bool(NETS[name])))
    assert told == {number: net for number, net in nets_of("U1").items() if int(number) in GPIO_OF_BOARD_PIN}


@pytest.mark.parametrize("value", PINS_ELSEWHERE)
def test_the_pins_of_a_part_are_those_that_others_have_read(value: str) -> None:
    """The two inputs of an AND gate are alike."""
    alike = {"A": "in", "B": "in", "Y": "out"} if value == "74LVC1G08" else {}
    drawn: dict[str, dict[int, str]] = defaultdict(dict)
    for pin in (*chain.from_iterable(NETLIST.values()), *OPEN):
        if pin.value == value:
            drawn[pin.part][int(pin.number)] = alike.get(pin.name, pin.name)
    assert drawn
    assert all(pins == dict(enumerate(PINS_ELSEWHERE[value].split(), 1)) for pins in drawn.values())


def test_relay_and_contactor_carry_the_numbers_of_their_terminals() -> None:
    """As EN 50005 has them: coil A1 and A2; contacts that close .3 and .4; main poles 1-2, 3-4, 5-6, 7-8."""
    assert set(nets_of("K1")) == {"13", "14", "23", "24"}
    contactor = nets_of("K2")
    assert set(contactor) == {"A1", "A2", *map(str, range(1, 9))}
    assert [(contactor[str(2 * i + 1)], contactor[str(2 * i + 2)]) for i in range(4)] == [
        (f"FUSED_{i}", f"SWITCHED_{i}") for i in range(4)
    ]


@pytest.mark.parametrize("net", sorted(NETLIST))
def test_a_net_has_two_ends_and_one_that_drives_it(net: str) -> None:
    kinds = [pin.kind for pin in NETLIST[net]]
    assert len(kinds) >= 2, "a net that ends nowhere"
    assert kinds.count("output") + kinds.count("power_out") <= 1, "two outputs against each other"
    if "power_in" in kinds:
        assert "power_out" in kinds, "a supply without a source"
    if "input" in kinds:
        assert set(kinds) - {"input", "power_in"}, "inputs that nothing drives"


def test_what_is_open_is_open_on_purpose() -> None:
    assert {(pin.part, pin.number) for pin in OPEN} == {("U1", n) for n in ("21", "22", "24", "25")} | {
        ("U2", "5"),
        ("U5", "7"),
    }


@pytest.mark.parametrize("channel", range(4))
def test_light_goes_through_interlock_and_one_shot_to_its_led(channel: int) -> None:
    """As in docs/firmware/wiring.md, the last lines of defence, 1, 2, 3 and 6."""
    gate = nets_of(one("74LVC1G08", f"LIGHT_{channel}"))
    assert {gate["1"], gate["2"]} == {"INTERLOCK", f"LIGHT_{channel}"}
    one_shot = nets_of(one("74LVC1G123", gate["4"]))
    assert (one_shot["1"], one_shot["2"], one_shot["3"]) == ("GND", "+3V3", gate["4"]), "it can only shorten a pulse"
    assert {pin.value for pin in NETLIST[gate["4"]]} == {"74LVC1G08", "74LVC1G123"}, "nothing goes past it"
    driver = nets_of(one("UCC27517A", one_shot["5"]))
    assert (driver["3"], driver["4"]) == (one_shot["5"], "GND")
    switch = nets_of(one("MOSFET 60 V, 10 mOhm", driver["5"]))
    assert nets_of(one("shunt 10m", switch["S"])) == {"1": switch["S"], "2": "GND"}
    led = nets_of(one("LED", switch["D"]))
    assert led["2"] == switch["D"]
    assert {pin.value for pin in NETLIST[led["1"]]} == {"LED", "limit 0.9, pulses"}, "nothing else bounds its current"
    (bank,) = set(nets_of(one("limit 0.9, pulses", led["1"])).values()) - {led["1"]}
    sources = {pin.value for pin in NETLIST[bank]} - {"limit 0.9, pulses", "470u", "10u, ceramic", "bleeder 47k"}
    assert sources == {"charge 100, 10 W"}, "all energy comes through the resistor"
    charge = nets_of(one("charge 100, 10 W", bank))
    (pole,) = set(charge.values()) - {bank}
    assert {pin.part for pin in NETLIST[pole]} == {"K2", one("charge 100, 10 W", bank)}, "behind the contactor"


@pytest.mark.parametrize("channel", range(4))
def test_a_switch_without_its_driver_is_open(channel: int) -> None:
    switch = one("MOSFET 60 V, 10 mOhm", f"GATE_{channel}")
    assert nets_of(one("10k", f"GATE_{channel}"))["2"] == NET_OF[switch, "S"]


def test_what_loses_its_supply_gives_no_edge() -> None:
    """The isolators without F go high then, which is rest on a serial line, and a shot on the trigger line."""
    assert NET_OF[one("ISO7710F", "TRIGGER"), "6"] == "TRIGGER"
    assert NET_OF[one("ISO7721", "UART_RX"), "2"] == "UART_RX"


@pytest.mark.parametrize("line", [f"{kind}_{i}" for kind in ("LIGHT", "CAMERA") for i in range(4)])
def test_every_output_is_pulled_down_outside_the_chip(line: str) -> None:
    assert "GND" in nets_of(one("10k", line)).values()


def test_the_supervisor_holds_the_reset_and_the_chain_feeds_gates_and_contactor() -> None:
    assert set(nets_of(one("1k", "RUN")).values()) == {"RUN", NET_OF["U3", "2"]}
    assert NET_OF["U3", "3"] == NET_OF["U1", "36"] == "+3V3"
    relay = nets_of("K1")
    assert set(nets_of(one("1k", "INTERLOCK")).values()) == {"INTERLOCK", relay["14"]}
    assert (relay["13"], relay["23"]) == ("+3V3", "+24V")
    assert nets_of("K2")["A1"] == relay["24"]


def test_kicads_own_check_finds_no_error(tmp_path: Path) -> None:
    """Its warnings say that the symbols are in the schematic alone."""
    kicad = shutil.which("kicad-cli")
    if kicad is None:
        pytest.skip("kicad-cli is not installed (KiCad 8 or later)")
    report = tmp_path / "erc.rpt"
    check = [kicad, "sch", "erc", "--severity-error", "--exit-code-violations", "-o", str(report), str(SCHEMATIC)]
    done = subprocess.run(check, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, report.read_text()
