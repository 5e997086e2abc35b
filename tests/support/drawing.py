"""Drawing a figure as a file, so that whatever is wrong with it shows."""

import io
from itertools import combinations

from matplotlib.figure import Figure


def drawn(figure: Figure) -> int:
    """Bytes of the picture: drawing it must work without a warning."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=50)
    return len(buffer.getvalue())


def collisions(figure: Figure) -> list[str]:
    """Panels, with their labels, and titles that overlap, or that the edge of the figure cuts off."""
    figure.draw_without_rendering()
    boxes = {f"panel {number} {axes.get_title()!r}": axes.get_tightbbox() for number, axes in enumerate(figure.axes)}
    boxes |= {repr(text.get_text()): text.get_window_extent() for text in figure.texts}
    shown = {name: box for name, box in boxes.items() if box is not None and box.width}
    width, height = figure.bbox.size
    cut = [name for name, box in shown.items() if min(box.x0, box.y0) < 0 or box.x1 > width or box.y1 > height]
    return cut + [f"{one} and {other}" for one, other in combinations(shown, 2) if shown[one].overlaps(shown[other])]
