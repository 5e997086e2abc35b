"""A computer without Aravis: everything works but cameras, and whoever opens one is told what to install."""

import subprocess
import sys

import pytest

PACKAGES = "apt install python3-gi gir1.2-aravis-0.8"
NO_GI = "import sys; sys.modules['gi'] = None\n"
NO_TYPELIB = """import sys, types
def refuse(name, version): raise ValueError(f"Namespace {name} not available")
sys.modules["gi"] = types.SimpleNamespace(require_version=refuse)
"""
OPEN_A_CAMERA = """
from pathlib import Path
from daq.drivers.aravis_camera import AravisCamera
from daq.drivers.camera_profile import load_camera_profile
from daq.errors import DeviceUnavailable
from daq.network import Network
try:
    profile = load_camera_profile(Path("configs/cameras/simulated.toml"))
    AravisCamera("view1", "127.0.0.1", profile, (1200, 1600), Network()).__enter__()
except DeviceUnavailable as error:
    print(error)
"""
COMMANDS = """
from server.cli.main import main
assert main(["optics", "--config", "configs/simulated.toml", "--json"]) == 0
assert main(["doctor", "--json"]) == 0
main(["--help"])
"""


def printed(code: str) -> str:
    """What a fresh interpreter prints that ends well."""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.mark.parametrize(
    ("without", "reason"), [(NO_GI, "import of gi halted"), (NO_TYPELIB, "Namespace Aravis not available")]
)
def test_whoever_opens_a_camera_is_told_what_to_install(without: str, reason: str) -> None:
    said = printed(without + OPEN_A_CAMERA)
    assert said.startswith("view1: Aravis cannot be loaded")
    assert reason in said
    assert PACKAGES in said


def test_commands_that_open_no_camera_work() -> None:
    """One after the other in one interpreter, which then has never loaded Aravis."""
    said = printed(NO_GI + COMMANDS)
    for expected in ("usage: tomoshadow", "airy_diameter_um", PACKAGES):
        assert expected in said


def test_a_server_that_starts_loads_neither_aravis_nor_what_draws_and_counts() -> None:
    heavy = ("gi", "matplotlib", "scipy.stats")
    asked = f"import sys, server.cli.main, server.web.serve\nprint([name for name in {heavy} if name in sys.modules])"
    assert printed(asked) == "[]\n"
