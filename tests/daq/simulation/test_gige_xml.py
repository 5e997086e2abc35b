from xml.etree import ElementTree

import pytest

from daq.simulation.camera.gige_registers import ExposureMode, PixelFormat, Register, RegisterBank
from daq.simulation.camera.gige_xml import camera_xml

SHAPE = (1200, 1600)
GENAPI = "{http://www.genicam.org/GenApi/Version_1_1}"


@pytest.fixture
def nodes() -> dict[str, ElementTree.Element]:
    root = ElementTree.fromstring(camera_xml(SHAPE))
    named = [(node.attrib["Name"], node) for node in root.iter() if "Name" in node.attrib]
    features = [(name, node) for name, node in named if node.tag not in (f"{GENAPI}EnumEntry", f"{GENAPI}pVariable")]
    assert len({name for name, _ in features}) == len(features)
    return dict(features)


def test_every_reference_leads_to_a_node(nodes: dict[str, ElementTree.Element]) -> None:
    references = [
        child.text
        for node in nodes.values()
        for child in node
        if child.tag.removeprefix(GENAPI) in ("pFeature", "pValue", "pPort", "pVariable")
    ]
    assert set(references) <= set(nodes)
    assert len(references) > 40


def test_every_writable_register_feature_may_be_written(nodes: dict[str, ElementTree.Element]) -> None:
    bank = RegisterBank("127.0.0.31", "SN31", SHAPE, 8000, camera_xml(SHAPE))
    registers = [node for node in nodes.values() if node.tag == f"{GENAPI}IntReg"]
    for node in registers:
        address = int(node.findtext(f"{GENAPI}Address", ""), 16)
        assert address in set(Register)
        assert bank.is_writable(address) == (node.findtext(f"{GENAPI}AccessMode") != "RO")


@pytest.mark.parametrize("name", ["ExposureMode", "PixelFormat"])
def test_enumerations_have_the_values_of_the_camera(nodes: dict[str, ElementTree.Element], name: str) -> None:
    values = {"ExposureMode": ExposureMode, "PixelFormat": PixelFormat}[name]
    entries = {
        entry.attrib["Name"]: int(entry.findtext(f"{GENAPI}Value", "-1"))
        for entry in nodes[name].iter(f"{GENAPI}EnumEntry")
    }
    assert entries == {value.name: int(value) for value in values}


def test_the_sensor_limits_the_image(nodes: dict[str, ElementTree.Element]) -> None:
    assert nodes["Width"].findtext(f"{GENAPI}Max") == "1600"
    assert nodes["Height"].findtext(f"{GENAPI}Max") == "1200"
