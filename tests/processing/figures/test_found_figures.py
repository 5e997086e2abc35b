"""Found, missed and ghosts are drawn with their numbers."""

import numpy as np
from matplotlib.patches import Rectangle

from processing.figures.found_figures import CLASSES_UM, Placed, found_figure
from server.demo.demo_droplets import COUNTED_UM


def test_every_group_is_named_with_its_number_and_counted_by_size() -> None:
    rng = np.random.default_rng(0)
    found, missed, ghosts = (Placed(rng.normal(size=(count, 3)), rng.uniform(30, 90, count)) for count in (20, 3, 0))
    figure = found_figure(found, missed, ghosts, "shot 0")
    above, by_size = figure.axes
    legend = above.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["found: 20", "missed: 3", "ghosts: 0"]
    sizes = {getattr(handle, "get_markersize", lambda: None)() for handle in legend.legend_handles}
    assert len(sizes) == 1, "dots of the legend are of one size, whatever droplets come first"
    assert None not in sizes
    heights = [patch.get_height() for patch in by_size.patches if isinstance(patch, Rectangle)]
    assert sum(heights) == 23


def test_a_class_begins_where_counting_does() -> None:
    """Else the first class of droplets from 30 um on is half empty."""
    assert np.isclose(CLASSES_UM, COUNTED_UM).any()
