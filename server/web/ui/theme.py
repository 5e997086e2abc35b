"""Look of the page: colours, cards, lamps, the grid of one screen. Dark and light."""

from pathlib import Path

from nicegui import ui

ACCENT = "#2f7de1"

_STYLE_SHEET = Path(__file__).with_name("theme.css")


def apply() -> ui.dark_mode:
    """Give the present page its look; returns the switch between dark and light."""
    ui.colors(primary=ACCENT, positive="#35b26a", negative="#d83c42", warning="#f0a92e")
    ui.add_css(_STYLE_SHEET)
    return ui.dark_mode(True)


def panel(title: str, extra: str = "") -> ui.card:
    """Card with a title; what follows in its ``with`` block goes inside."""
    card = ui.card().classes(f"panel {extra}").props(f'role=region aria-label="{title}"')
    with card:
        ui.label(title).classes("panel-title")
    return card
