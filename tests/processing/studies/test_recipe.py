"""Recipes: names that can be read back, and iterations that go on where the recipe before stopped."""

import numpy as np
import pytest

from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.reconstruction.smart import mart, smart
from processing.studies.recipe import ALL_RECIPES, Recipe, reconstruct_each
from processing.studies.simulated_droplets import simulate_shot, study_cameras, study_grid

GRID = study_grid((40, 40, 60))
CAMERAS = study_cameras((112, 72))


@pytest.mark.parametrize("recipe", [*ALL_RECIPES, Recipe.named("mart-1"), Recipe.named("smart", 7)])
def test_a_name_can_be_read_back(recipe: Recipe) -> None:
    assert Recipe.named(recipe.name) == recipe


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("smrt", "'smrt' is none of gavlos"),
        ("smart-x", "none of"),
        ("smart-0", "smart does not take 0 iterations"),
        ("mlos-3", "mlos does not take 3 iterations"),
    ],
)
def test_what_is_no_recipe_is_refused(name: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Recipe.named(name)


@pytest.mark.parametrize(("method", "reconstruct", "nowhere_more"), [("smart", smart, 1e-3), ("mart", mart, 2e-2)])
def test_iterations_go_on_as_if_never_stopped(method: str, reconstruct: type, nowhere_more: float) -> None:
    plan, shot = plan_reconstruction(CAMERAS, GRID), simulate_shot(GRID, 30, 1.5, CAMERAS)
    volume = np.empty(GRID.shape, np.float32)
    recipes = [Recipe.named(f"{method}-{iterations}") for iterations in (2, 5)]
    for recipe in reconstruct_each(plan, shot.images, recipes, volume):
        straight = reconstruct(plan, shot.images, iterations=recipe.iterations).volume
        # each correction rounds to float16; MART corrects twelve times more, unless half a count decides
        np.testing.assert_allclose(volume, straight, rtol=4 * 2**-11, atol=nowhere_more * float(straight.max()))
        assert np.linalg.norm(volume - straight) < 3e-3 * np.linalg.norm(straight)


def test_other_recipes_start_anew() -> None:
    smart_10 = Recipe(ReconstructionMethod.SMART, 10)
    assert smart_10.continues(Recipe.named("smart-5"))
    for before in (None, Recipe.named("mlos"), Recipe.named("mart-5"), smart_10, Recipe.named("smart")):
        assert not smart_10.continues(before)
