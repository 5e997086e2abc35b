"""Look of the page: colours, cards, lamps, the grid of one screen. Dark and light."""

from pathlib import Path

from nicegui import ui

_COLOURS = {"primary": "#1f5fb8", "positive": "#1d7a48", "negative": "#c4272d", "warning": "#f0a92e"}
"""Each but amber with white words on it; on a dark page, words of these colours are lighter (theme.css)."""
_LANGUAGE = '<script>document.documentElement.lang = "en"</script>'

_STYLE_SHEETS = sorted(Path(__file__).parent.rglob("*.css"), key=lambda path: (len(path.parts), path))
"""That of all pages first, then that of each room, beside its modules."""


def apply() -> None:
    """Give the present page its look; whether it is dark is the browser's affair."""
    ui.colors(**_COLOURS)
    ui.add_head_html(_LANGUAGE)
    for style_sheet in _STYLE_SHEETS:
        ui.add_css(style_sheet)


def panel(title: str, extra: str = "") -> ui.card:
    """Card with a title; what follows in its ``with`` block goes inside."""
    card = ui.card().classes(f"panel {extra}").props(f'role=region aria-label="{title}"')
    with card:
        ui.label(title).classes("panel-title")
    return card
