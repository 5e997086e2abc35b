"""Building the firmware: its core for this computer, and the image for the Raspberry Pi Pico."""

import shutil
import subprocess
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from daq.errors import DeviceTimeout, DeviceUnavailable

_DEVICE = "simulated pulse generator"
_ROOT = Path(__file__).resolve().parents[3]
_BUILD_DIR = _ROOT / "build" / "firmware"
_BUILD_LIMIT_S = 60.0


class ImageKind(StrEnum):
    """For which board an image is; the value is the name of its files.

    With a converter for the currents and a serial line to the host, or with PWM instead of the converter, or with USB
    instead of the line.
    """

    CONVERTER = "tomoshadow-rp2040"
    PWM = "tomoshadow-rp2040-pwm"
    USB = "tomoshadow-rp2040-usb"


@dataclass(frozen=True)
class _Target:
    make: str
    product: str
    tools: tuple[str, ...]
    packages: str


_HOST = _Target("host", "firmware_host", ("make", "cc"), "gcc make")


def build_firmware(build_dir: Path = _BUILD_DIR) -> Path:
    """Path of the core's host build, compiled if it is missing or older than its sources.

    Raises
    ------
    DeviceUnavailable
        It is missing and cannot be compiled here; the text says what is needed.
    """
    return _built(_HOST, build_dir)


def build_image(build_dir: Path = _BUILD_DIR, kind: ImageKind = ImageKind.CONVERTER) -> Path:
    """Path of a binary image of the RP2040, linked if it is missing or older than its sources; UF2 and ELF beside it.

    Raises
    ------
    DeviceUnavailable
        It is missing and cannot be compiled here; the text says what is needed.
    """
    return _built(_Target("images", f"{kind}.bin", ("make", "arm-none-eabi-gcc"), "gcc-arm-none-eabi make"), build_dir)


def _built(target: _Target, build_dir: Path) -> Path:
    product = build_dir / target.product
    missing = [tool for tool in target.tools if shutil.which(tool) is None]
    if missing and not product.exists():
        raise DeviceUnavailable(
            _DEVICE,
            f"{product} is missing, and so is {' and '.join(missing)} to build it (apt install {target.packages})",
        )
    if not missing:
        _make(target, build_dir)
    return product


def _make(target: _Target, build_dir: Path) -> None:
    command = ["make", "--no-print-directory", "-C", str(_ROOT / "firmware"), target.make, f"BUILD={build_dir}"]
    try:
        subprocess.run(command, check=True, capture_output=True, text=True, timeout=_BUILD_LIMIT_S)
    except subprocess.CalledProcessError as error:
        raise DeviceUnavailable(_DEVICE, f"{' '.join(command)} failed: {error.stderr.strip()}") from error
    except subprocess.TimeoutExpired as error:
        raise DeviceTimeout(_DEVICE, " ".join(command), _BUILD_LIMIT_S) from error
