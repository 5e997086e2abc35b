"""Rig configurations: every example loads, every mistake is named with file, line, key, value and limit."""

import re
from pathlib import Path

import pytest
from pydantic import ValidationError

from processing.runs.toml_lines import line_of
from processing.synthetic.paper_rig import IMAGE_SIZE_PX, PIXEL_PITCH_UM, TABLE_1
from server.rig.config import ConfigError, RigConfig, load_config

CONFIGS = Path("configs")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "cameras").mkdir()
    for profile in (CONFIGS / "cameras").glob("*.toml"):
        (tmp_path / "cameras" / profile.name).write_text(profile.read_text())
    return tmp_path


def mended(folder: Path, wrong: str, right: str) -> Path:
    """The simulated rig with one line replaced."""
    text = (CONFIGS / "simulated.toml").read_text()
    assert wrong in text
    path = folder / "rig.toml"
    path.write_text(text.replace(wrong, right, 1))
    return path


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.name)
def test_every_example_loads(path: Path) -> None:
    config = load_config(path)
    assert all(view.camera.profile.is_file() for view in config.views.values())


@pytest.mark.parametrize("name", ["simulated.toml", "spray4view.toml"])
def test_both_examples_are_the_rig_of_table_1(name: str) -> None:
    config = load_config(CONFIGS / name)
    assert list(config.views) == list(TABLE_1)
    for view, row in zip(config.views.values(), TABLE_1.values(), strict=True):
        lens, sensor = view.lens, view.sensor
        assert (lens.f_number, lens.focal_length_mm) == (row.f_number, row.focal_length_mm)
        assert (view.azimuth_deg, lens.magnification) == (row.azimuth_deg, row.magnification)
        assert view.nominal_current_a == row.current_a
        assert ((sensor.width_px, sensor.height_px), sensor.pixel_pitch_um) == (IMAGE_SIZE_PX, PIXEL_PITCH_UM)
    assert (config.target.columns, config.target.rows, config.target.pitch_mm) == (23, 17, 1.0)


@pytest.mark.parametrize(
    ("wrong", "right", "message"),
    [
        (
            "f_number = 22",
            "f_number = 0",
            r"rig\.toml:8: views\.view1\.lens\.f_number: 0 .* greater than or equal to 0\.7",
        ),
        (
            "pixel_pitch_um = 7.4",
            "pixel_pitch_um = 0.0074",
            r"_pitch_um: 0\.0074 .* greater than or equal to 0\.5",
        ),
        ("led_channel = 1", "led_channel = 4", r":16: views\.view2\.led_channel: 4 .* less than or equal to 3"),
        ("led_channel = 1", "led_channel = 0", r"led_channel \[0\] is used by two views"),
        ("127.0.1.2", "127.0.1.1", r"camera\.ip \['127\.0\.1\.1'\] is used by two views"),
        ("127.0.1.2", "10.0.1.2", r"camera\.ip \['10\.0\.1\.2'\]: .* loopback"),
        ("127.0.1.2", "camera2", r":15: views\.view2\.camera\.ip: 'camera2' .*IPv4"),
        ("cameras/simulated.toml", "cameras/none.toml", r":6: views\.view1\.camera\.profile: .*no file .*none\.toml"),
        ("nominal_current_a = 9.9", "nominal_current_a = 12.5", r"nominal_current_a 12\.5 is above max_current_a 12"),
        ("pitch_mm = 1.0", "pich_mm = 1.0", r"target\.pich_mm: 1\.0 Extra inputs are not permitted"),
        ("range_mm = [-5.0, 5.0]", "range_mm = [5.0, -5.0]", r"stage\.range_mm: .* first value must be below"),
        ('host = "127.0.0.1"', 'host = "0.0.0.0"', r"server: host 0\.0\.0\.0 .* set a token"),
        ('data_dir = "runs"', r'data_dir = "ru\u0000ns"', r"server\.data_dir: .*NUL"),
        ('data_dir = "runs"', 'data_dir = ""', r":\d+: server\.data_dir: .*empty"),
        ('data_dir = "runs"', 'data_dir = "  "', r":\d+: server\.data_dir: .*empty"),
        ("[simulation]", "[simulations]", r"simulations: .*not permitted"),
        ("seed = 1", "seed = = 1", r"rig\.toml: Invalid value \(at line \d+"),
    ],
)
def test_a_mistake_is_named(folder: Path, wrong: str, right: str, message: str) -> None:
    path = mended(folder, wrong, right)
    with pytest.raises(ConfigError, match=message):
        load_config(path)


def test_all_mistakes_are_told_at_once(folder: Path) -> None:
    path = mended(folder, 'firmware = "host"\ngpio = "auto"', 'firmware = "guest"\ngpio = "guess"')
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert re.findall(r"simulation\.(\w+): '(\w+)'", str(caught.value)) == [("firmware", "guest"), ("gpio", "guess")]


def test_a_fault_of_an_unknown_view_is_named(folder: Path) -> None:
    fault = '[[simulation.faults]]\nsequence = 3\nkind = "dropped_b"\nview = "view9"\n'
    path = mended(folder, "# Faults", fault + "# Faults")
    with pytest.raises(ConfigError, match=r"simulation\.faults: there is no view \['view9'\]"):
        load_config(path)


def test_a_rig_without_simulation_needs_its_light_and_its_interlock(folder: Path) -> None:
    text = (CONFIGS / "simulated.toml").read_text().split("[simulation]")[0]
    (folder / "rig.toml").write_text(text)
    with pytest.raises(ConfigError, match=r"pulse_generator and interlock: missing"):
        load_config(folder / "rig.toml")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml.*No such file"):
        load_config(tmp_path / "none.toml")


def test_a_configuration_is_frozen_and_hides_its_token(folder: Path) -> None:
    config = load_config(mended(folder, 'host = "127.0.0.1"', 'token = "secret-word"\nhost = "0.0.0.0"'))
    assert "secret-word" not in repr(config) + config.model_dump_json()
    with pytest.raises(ValidationError, match="frozen"):
        config.name = "other"


def test_a_dumped_configuration_reads_back() -> None:
    config = load_config(CONFIGS / "simulated.toml")
    assert RigConfig.model_validate_json(config.model_dump_json()) == config


def test_lines_of_keys_tables_and_their_elements() -> None:
    text = 'a = 1\n[b.c] # table\nd = {e = 1}\n[[f]]\nx = 1\n[[f]]\n  x = 2\n["g".h]\n"i" = 3\n'
    assert line_of(text, ("a",)) == 1
    assert line_of(text, ("b", "c", "d", "e")) == 3
    assert line_of(text, ("b", "c", "missing")) == 2
    assert line_of(text, ("f", 1, "x")) == 7
    assert line_of(text, ("g", "h", "i")) == 9
    assert line_of(text, ("nowhere",)) is None


@pytest.mark.parametrize(
    ("lines", "text"),
    [
        ('scheduler = "lab:8786"', "processing.scheduler: 'lab:8786' is no address of a scheduler, for example tls://"),
        ('scheduler = "tcp://10.0.0.1:8786"', "'tcp://10.0.0.1:8786' leaves this computer without encryption"),
        (
            'scheduler = "tls://10.0.0.1:8786"',
            "scheduler tls://10.0.0.1:8786: needs certificates, the folder",
        ),
        (
            'scheduler = "tls://10.0.0.1:8786"\ncertificates = "lab"',
            "processing.certificates: 'lab' there is no file {folder}/lab/ca.pem; docs/cluster.md tells how to make it",
        ),
        ('scheduler = "tcp://127.0.0.1:8786"\nworkers = 2', "workers: of this computer; with a scheduler, tomoshadow"),
        ('paths = { "/data" = "/mnt/data" }', "paths: of a scheduler, and there is none; name it, or leave it out"),
        ('memory_per_worker = "much"', "processing.memory_per_worker: 'much' String should match pattern"),
    ],
)
def test_processing_that_cannot_be_is_told_with_file_and_key(lines: str, text: str, tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    small = (
        Path("configs/simulated_small.toml").read_text().replace('"cameras/', f'"{Path("configs").absolute()}/cameras/')
    )
    file.write_text(f"{small}\n[processing]\n{lines}\n")
    with pytest.raises(ConfigError) as error:
        load_config(file)
    assert str(error.value).startswith(f"{file}:")
    assert text.format(folder=tmp_path) in str(error.value)
