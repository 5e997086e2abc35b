from pathlib import Path

import pytest

from daq.drivers.camera_profile import CameraProfile, FeatureValue, FeatureWrite, load_camera_profile
from daq.errors import PlanError
from daq.run_plan import PulsePair, RunPlan
from daq.timing import plan_shot_timing

CONFIGS = Path(__file__).parents[3] / "configs" / "cameras"
SIMULATED = (CONFIGS / "simulated.toml").read_text()


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_profile_loads_and_straddles_the_separation_of_the_paper(path: Path) -> None:
    profile = load_camera_profile(path)
    plan = RunPlan(name="paper", shots=1, pulse=PulsePair(current_a={"view1": 10.0}))
    timing = plan_shot_timing(plan, {"view1": profile.camera_timing}).views["view1"]
    assert timing.pulse_a.close_ns < timing.frame_a.close_ns < timing.frame_b.open_ns < timing.pulse_b.open_ns


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_profile_writes_trigger_mode_alone_before_the_source(path: Path) -> None:
    names = [setting.feature for setting in load_camera_profile(path).features]
    assert names.count("TriggerMode") == 1
    assert names.index("TriggerMode") < names.index("TriggerSource")


def test_the_order_of_the_file_is_kept() -> None:
    features = load_camera_profile(CONFIGS / "simulated.toml").features
    assert [setting.feature for setting in features[:3]] == ["TriggerSelector", "TriggerMode", "TriggerSource"]


def test_round_trip() -> None:
    profile = load_camera_profile(CONFIGS / "simulated.toml")
    assert CameraProfile.model_validate_json(profile.model_dump_json()) == profile


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("gap_ns = 500", "gap_us = 500", r"timing\.gap_ns: Field required"),
        ("gap_ns = 500", "gap_ns = 500\nguard_us = 1", r"timing\.guard_us: Extra inputs are not permitted, got 1"),
        ("gap_ns = 500", "gap_ns = -1", r"timing\.gap_ns: .* greater than or equal to 0, got -1"),
        ('"Mono8"', '"BayerRG8"', r"pixel_format: .*, got 'BayerRG8'"),
        ('feature = "TriggerMode", value', 'feature = "TriggerMode", vlaue', r"features\.1\.value: Field required"),
        ("[timing]", "[timing", r"line 1?\d"),
        ('"Mono8"', '"Mono8"\nstacked = true', "stacked exposures are two per trigger, and one image has one stamp"),
    ],
)
def test_faults_name_file_and_key(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(SIMULATED.replace(old, new, 1))
    with pytest.raises(PlanError, match=rf"camera\.toml: .*{complaint}"):
        load_camera_profile(path)


def test_an_absent_profile_is_named(tmp_path: Path) -> None:
    with pytest.raises(PlanError, match=r"nothing\.toml: No such file"):
        load_camera_profile(tmp_path / "nothing.toml")


@pytest.mark.parametrize(
    ("wanted", "tolerance", "actual", "met"),
    [
        ("Line1", 0, "Line1", True),
        ("Line1", 0, "Line2", False),
        (10.0, 0.5, 10.4, True),
        (10.0, 0.5, 10.6, False),
        (10.0, 0, 10.0, True),
        (True, 0, False, False),
        (2, 0, 3, False),
    ],
)
def test_a_value_that_reads_back_is_judged_by_its_tolerance(
    wanted: FeatureValue, tolerance: float, actual: FeatureValue, met: bool
) -> None:
    assert FeatureWrite(feature="F", value=wanted, tolerance=tolerance).is_met_by(actual) == met
