"""Recipes: what is written is read as it was, and what is wrong is named with its line."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from processing.reconstruction.choices import Accuracy, ReconstructionMethod, VoxelType
from processing.reconstruction.settings import GridSettings, ReconstructionSettings
from processing.runs.droplets.measure_settings import MeasureSettings
from processing.runs.recipe import RecipeError, read_recipe, recipe_sha256, write_recipe

MM = st.floats(-100, 100)
GRIDS = st.builds(
    GridSettings,
    shape=st.tuples(*[st.integers(1, 999)] * 3),
    origin_mm=st.tuples(MM, MM, MM),
    pitch_mm=st.floats(1e-6, 10),
)
SETTINGS = st.builds(
    ReconstructionSettings,
    method=st.sampled_from(ReconstructionMethod),
    accuracy=st.sampled_from(Accuracy),
    voxels=st.sampled_from(VoxelType),
    iterations=st.integers(1, 200),
    relaxation=st.floats(1e-9, 2),
    grid=st.none() | GRIDS,
    noise_floor=st.floats(0, 0.99),
)
BOX = "\n[settings.grid]\nshape = [9, 9, 9]\norigin_mm = [{}]\npitch_mm = {}\n"
HEAD = 'schema = "tomoshadow/recipe"\nschema_version = 1\ncommand = "measure"\n'


@given(SETTINGS)
def test_what_is_written_is_read_to_the_last_digit(
    tmp_path_factory: pytest.TempPathFactory, settings: ReconstructionSettings
) -> None:
    path = tmp_path_factory.mktemp("recipe") / "recipe.toml"
    write_recipe(path, "reconstruct", 2, settings)
    read = read_recipe(path, "reconstruct", 2, ReconstructionSettings)
    assert read == settings
    assert recipe_sha256("reconstruct", 2, read) in path.read_text()


def test_every_setting_is_spelled_out_and_explained(tmp_path: Path) -> None:
    write_recipe(tmp_path / "recipe.toml", "measure", 1, MeasureSettings())
    text = (tmp_path / "recipe.toml").read_text()
    for name, field in MeasureSettings.model_fields.items():
        assert f"\n{name} = " in text or f"\n# {name} is not set" in text
        assert f"# {field.description}" in text


def measured(tmp_path: Path, text: str) -> MeasureSettings:
    path = tmp_path / "recipe.toml"
    path.write_text(text)
    return read_recipe(path, "measure", 1, MeasureSettings)


def test_what_a_recipe_does_not_say_has_its_default(tmp_path: Path) -> None:
    assert measured(tmp_path, HEAD) == MeasureSettings()
    assert measured(tmp_path, HEAD + "[settings]\ntwins = 2\n") == MeasureSettings(twins=2)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (HEAD + "[settings]\n\ntwinz = 1\n", r"recipe\.toml, line 6: settings\.twinz: there is no such key here"),
        (HEAD + "[settings]\ntwins = -1\n", r"line 5: settings\.twins: Input should be greater than or equal to 0"),
        (HEAD + "[settings]\ntwins = true\n", r"line 5: settings\.twins: Input should be a valid integer"),
        (HEAD + '[settings]\ntwins = "1"\n', r"line 5: settings\.twins: Input should be a valid integer"),
        (HEAD + "[settings]\ntwins = 2020-01-01\n", r"line 5: settings\.twins: Input should be a valid integer"),
        (HEAD + "method_version = true\n", r"line 4: method_version: Input should be a valid integer"),
        (HEAD + BOX.format("0, 0, inf", "1"), r"line 7: settings\.grid\.origin_mm\.2: Input should be a finite number"),
        (HEAD + BOX.format("0, 0, 0", "inf"), r"line 8: settings\.grid\.pitch_mm: Input should be a finite number"),
        (HEAD + BOX.format("0, 0, 0", "1").replace("9", "99999"), r"line 6: settings\.grid\.shape: .* too many"),
        (HEAD + "[settings.grid]\npitch_um = 1\n", r"line 5: settings\.grid\.pitch_um: there is no such key"),
        (HEAD + "[setting]\ntwins = 1\n", r"line 4: setting: there is no such key here.*schema, schema_version"),
        (HEAD.replace("measure", "reconstruct"), r"line 3: command: a recipe for reconstruct, not for"),
        (HEAD.replace("measure", "measure-single-view"), r"not for measure; leave out --calibration"),
        (HEAD + "method_version = 8\n", r"line 4: method_version: numbers of version 8 .* not comparable"),
        (HEAD.replace("= 1", "= 2"), r"line 2: schema_version: Input should be 1"),
        (HEAD.replace("schema =", "# schema ="), r"recipe\.toml: schema: this key is missing"),
        (HEAD + "[settings\n", r"recipe\.toml: .*line 4"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, text: str, error: str) -> None:
    with pytest.raises(RecipeError, match=error):
        measured(tmp_path, text)


def test_a_recipe_for_a_calibration_says_what_is_missing(tmp_path: Path) -> None:
    (tmp_path / "recipe.toml").write_text(HEAD)
    with pytest.raises(RecipeError, match=r"for measure, not for measure-single-view; state the --calibration"):
        read_recipe(tmp_path / "recipe.toml", "measure-single-view", 1, MeasureSettings)


def test_a_recipe_that_is_not_there_or_not_text_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecipeError, match=r"none\.toml: No such file"):
        read_recipe(tmp_path / "none.toml", "measure", 1, MeasureSettings)
    (tmp_path / "recipe.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(RecipeError, match=r"recipe\.toml: not UTF-8: byte 0 is 0xff"):
        read_recipe(tmp_path / "recipe.toml", "measure", 1, MeasureSettings)


def test_the_hash_is_of_what_is_said_not_of_how(tmp_path: Path) -> None:
    plain = measured(tmp_path, HEAD + "[settings]\ntwins = 1\nseed = 0\n")
    other = measured(tmp_path, "# mine\n" + HEAD + "[settings]\nseed = 0x0 # zero\ntwins = 1\n")
    assert recipe_sha256("measure", 1, plain) == recipe_sha256("measure", 1, other)
    different = {recipe_sha256("measure", 1, MeasureSettings(twins=twins)) for twins in range(3)}
    assert len(different | {recipe_sha256("measure", 2, plain), recipe_sha256("reconstruct", 1, plain)}) == 5
