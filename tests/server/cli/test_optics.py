"""``tomoshadow optics``."""

import shutil
from pathlib import Path

import pytest

from tests.support.command_line import refused, shown, told

ROOT = Path(__file__).parents[3]


def test_optics_of_the_papers_rig(capsys: pytest.CaptureFixture[str]) -> None:
    result = told(capsys, "optics", "--config", ROOT / "configs" / "spray4view.toml")
    assert [round(view["airy_diameter_um"]) for view in result["views"].values()] == [39, 28, 28, 38]


def test_a_misspelt_configuration_key_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    config = tmp_path / "configs" / "simulated.toml"
    config.write_text(config.read_text().replace("led_channel = 0", "led_chanel = 0"))
    assert "led_chanel" in refused(capsys, "optics", "--config", config)


def test_people_get_a_line_per_view(capsys: pytest.CaptureFixture[str]) -> None:
    text = shown(capsys, "optics", "--config", ROOT / "configs" / "spray4view.toml")
    heads, *views, motion, window = text.splitlines()
    assert heads.startswith("view   px/mm  field [mm]   depth of field [mm]  d_A [um]")
    assert [line.split()[0] for line in views] == ["view1", "view2", "view3", "view4"]
    assert motion == ("droplets of 34.6 m/s, pulses of 1000 ns, 6400 ns apart: blur 34.6 um, displacement 221.4 um")
    assert window == "all cameras accept 2100 to 67606900 ns"
