"""GenICam description of the simulated camera, generated from its register map."""

from enum import IntEnum
from xml.etree.ElementTree import Element, SubElement, tostring

from daq.simulation.camera.gige_registers import ExposureMode, PixelFormat, Register, TriggerSource

_CATEGORIES = {
    "DeviceControl": ("DeviceVendorName", "DeviceModelName", "DeviceVersion", "DeviceID"),
    "ImageFormatControl": ("Width", "Height", "OffsetX", "OffsetY", "PixelFormat"),
    "AcquisitionControl": (
        "AcquisitionMode",
        "AcquisitionStart",
        "AcquisitionStop",
        "TriggerSelector",
        "TriggerMode",
        "TriggerSource",
        "TriggerActivation",
        "ExposureMode",
        "ExposureTime",
    ),
    "TransportLayerControl": ("PayloadSize", "GevTimestampTickFrequency"),
}
_ROOT = {
    "ModelName": "SimulatedDoubleFrame",
    "VendorName": "tomoshadow",
    "ToolTip": "Simulated double-frame camera",
    "StandardNameSpace": "GEV",
    "SchemaMajorVersion": "1",
    "SchemaMinorVersion": "1",
    "SchemaSubMinorVersion": "0",
    "MajorVersion": "1",
    "MinorVersion": "0",
    "SubMinorVersion": "0",
    "ProductGuid": "0",
    "VersionGuid": "0",
    "xmlns": "http://www.genicam.org/GenApi/Version_1_1",
}


class _AcquisitionMode(IntEnum):
    Continuous = 0


class _TriggerSelector(IntEnum):
    FrameStart = 0


class _Switch(IntEnum):
    Off = 0
    On = 1


class _TriggerActivation(IntEnum):
    RisingEdge = 0
    FallingEdge = 1


def camera_xml(sensor_shape: tuple[int, int]) -> bytes:
    """GenICam XML of a camera whose sensor has (rows, columns)."""
    root = Element("RegisterDescription", _ROOT)
    _categories(root)
    _texts(root)
    _image_format(root, sensor_shape)
    _acquisition(root)
    _register(root, "GevTimestampTickFrequency", Register.TICK_FREQUENCY_LOW, "RO")
    SubElement(root, "Port", Name="Device")
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root)


def _categories(root: Element) -> None:
    _node(root, "Category", "Root", *(("pFeature", category) for category in _CATEGORIES))
    for category, features in _CATEGORIES.items():
        _node(root, "Category", category, *(("pFeature", feature) for feature in features))


def _texts(root: Element) -> None:
    for name, address, length in (
        ("DeviceVendorName", Register.VENDOR_NAME, 32),
        ("DeviceModelName", Register.MODEL_NAME, 32),
        ("DeviceVersion", Register.DEVICE_VERSION, 32),
        ("DeviceID", Register.SERIAL_NUMBER, 16),
    ):
        _node(root, "StringReg", name, ("Address", hex(address)), ("Length", length), ("AccessMode", "RO"), _PORT)


def _image_format(root: Element, sensor_shape: tuple[int, int]) -> None:
    rows, columns = sensor_shape
    _integer(root, "Width", Register.WIDTH, 1, columns)
    _integer(root, "Height", Register.HEIGHT, 1, rows)
    _integer(root, "OffsetX", Register.OFFSET_X, 0, columns - 1)
    _integer(root, "OffsetY", Register.OFFSET_Y, 0, rows - 1)
    _enumeration(root, Register.PIXEL_FORMAT, PixelFormat)
    payload = _node(root, "IntSwissKnife", "PayloadSize")
    for variable in ("Width", "Height", "PixelFormat", "ExposureMode"):
        SubElement(payload, "pVariable", Name=variable.upper()).text = f"{variable}Register"
    images = f"(EXPOSUREMODE = {ExposureMode.StackedDoubleFrame:d} ? 2 : 1)"
    SubElement(payload, "Formula").text = f"{images} * WIDTH * HEIGHT * ((PIXELFORMAT >> 16) & 0xFF) / 8"


def _acquisition(root: Element) -> None:
    _enumeration(root, Register.ACQUISITION_MODE, _AcquisitionMode)
    _register(root, "AcquisitionRegister", Register.ACQUISITION, "WO")
    for name, value in (("AcquisitionStart", 1), ("AcquisitionStop", 0)):
        _node(root, "Command", name, ("pValue", "AcquisitionRegister"), ("CommandValue", value))
    _enumeration(root, Register.TRIGGER_SELECTOR, _TriggerSelector)
    _enumeration(root, Register.TRIGGER_MODE, _Switch)
    _enumeration(root, Register.TRIGGER_SOURCE, TriggerSource)
    _enumeration(root, Register.TRIGGER_ACTIVATION, _TriggerActivation)
    _enumeration(root, Register.EXPOSURE_MODE, ExposureMode)
    _exposure_time(root)


def _exposure_time(root: Element) -> None:
    _register(root, "ExposureTimeRegister", Register.EXPOSURE_TIME_NS, "RO")
    formulas = (("FormulaTo", "FROM * 1000"), ("FormulaFrom", "TO / 1000"), ("pValue", "ExposureTimeRegister"))
    _node(root, "Converter", "ExposureTimeInNanoseconds", *formulas)
    _node(root, "Float", "ExposureTime", ("pValue", "ExposureTimeInNanoseconds"), ("Unit", "us"))


_PORT = ("pPort", "Device")


def _node(root: Element, kind: str, name: str, *children: tuple[str, object]) -> Element:
    node = SubElement(root, kind, Name=name)
    for tag, text in children:
        SubElement(node, tag).text = str(text)
    return node


def _register(root: Element, name: str, register: Register, access: str = "RW") -> None:
    place = (("Address", hex(register)), ("Length", 4), ("AccessMode", access), _PORT)
    _node(root, "IntReg", name, *place, ("Cachable", "NoCache"), ("Sign", "Unsigned"), ("Endianess", "BigEndian"))


def _integer(root: Element, name: str, register: Register, lowest: int, highest: int) -> None:
    _node(root, "Integer", name, ("pValue", f"{name}Register"), ("Min", lowest), ("Max", highest))
    _register(root, f"{name}Register", register)


def _enumeration(root: Element, register: Register, values: type[IntEnum]) -> None:
    name = register.name.title().replace("_", "")
    node = _node(root, "Enumeration", name)
    for value in values:
        _node(node, "EnumEntry", value.name, ("Value", int(value)))
    SubElement(node, "pValue").text = f"{name}Register"
    _register(root, f"{name}Register", register)
