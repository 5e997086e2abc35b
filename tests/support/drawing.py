"""Drawing a figure as a file, so that whatever is wrong with it shows."""

import io

from matplotlib.figure import Figure


def drawn(figure: Figure) -> int:
    """Bytes of the picture: drawing it must work without a warning."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=50)
    return len(buffer.getvalue())
