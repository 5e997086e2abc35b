"""What is drawn in one figure can be told apart."""

from processing.figures.colours import method_style
from processing.studies.recipe import ALL_RECIPES


def test_no_two_curves_of_a_figure_look_alike() -> None:
    styles = [method_style(recipe.method, recipe.iterations) for recipe in ALL_RECIPES]
    assert len({style["color"] for style in styles}) == len(styles)
    stages = [method_style("smart", iterations) for iterations in (5, 10, 20)]
    assert len({style["marker"] for style in stages}) == len({style["linestyle"] for style in stages}) == 3
    assert [style["marker"] for style in stages] == ["^", "s", "o"]
