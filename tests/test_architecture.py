"""The house keeps its shape: layers, names, sizes."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("daq", "processing", "server", "tomoshadow")
NAMELESS = {"utils", "util", "helper", "helpers", "manager", "common", "base", "misc"}
SOURCES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
ROOMS = sorted({path.parent for path in SOURCES})


def test_dependencies_point_one_way() -> None:
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=100, check=False)
    assert result.returncode == 0, result.stdout


def test_vendor_libraries_have_one_home() -> None:
    homes = {
        "gi": {"daq/drivers/aravis_device.py"},
        "serial": {"daq/drivers/pulse_line.py", "daq/drivers/serial_stage.py"},
        "gpiod": {"daq/drivers/gpio_interlock.py"},
        "distributed": {str(path.relative_to(ROOT)) for path in (ROOT / "server" / "lab" / "engine").glob("*.py")},
    }
    for library, allowed in homes.items():
        users = {str(path.relative_to(ROOT)) for path in SOURCES if _imports(path, library)}
        assert users, f"nobody imports {library}"
        assert users <= allowed, f"{library} is imported by {users - allowed}"
    for path in (path for path in SOURCES if _imports(path, "h5py")):
        assert path.stem.endswith(("file", "encoding", "columns")), f"{path} imports h5py"


def _imports(path: Path, library: str) -> bool:
    return any(
        line.lstrip().startswith((f"import {library}", f"from {library} ", f"from {library}."))
        for line in path.read_text().splitlines()
    )


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(ROOT)))
def test_a_room_has_few_modules_and_says_what_lives_there(room: Path) -> None:
    modules = [path for path in room.glob("*.py") if path.stem != "__init__"]
    assert len(modules) <= 18
    front = room / "__init__.py"
    assert front.is_file()
    assert front.read_text().count(".") >= 2, "an __init__ says in two sentences what lives there and who may import it"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_module_is_small_and_says_what_it_is(path: Path) -> None:
    text = path.read_text()
    assert path.stem not in NAMELESS
    assert text.removeprefix("r").startswith('"""'), "a module begins with what it is"
    assert text.count("\n") <= 300
