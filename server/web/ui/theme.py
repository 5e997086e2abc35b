"""Look of the page: colours, cards, lamps, the grid of one screen. Dark and light."""

from pathlib import Path

from nicegui import ui

ACCENT = "#2f7de1"

_STYLE_SHEETS = sorted(Path(__file__).parent.rglob("*.css"), key=lambda path: (len(path.parts), path))
"""That of all pages first, then that of each room, beside its modules."""


def apply() -> None:
    """Give the present page its look; whether it is dark is the browser's affair."""
    ui.colors(primary=ACCENT, positive="#35b26a", negative="#d83c42", warning="#f0a92e")
    for style_sheet in _STYLE_SHEETS:
        ui.add_css(style_sheet)


def panel(title: str, extra: str = "") -> ui.card:
    """Card with a title; what follows in its ``with`` block goes inside."""
    card = ui.card().classes(f"panel {extra}").props(f'role=region aria-label="{title}"')
    with card:
        ui.label(title).classes("panel-title")
    return card
