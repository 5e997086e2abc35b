"""A box with a scene in space: dragged by the mouse, turned by Shift and arrow keys, moved by arrow keys alone."""

from nicegui import ui

_BEGIN = """() => {
    const scene = getElement(%d), box = scene.$el;
    new ResizeObserver(() => window.dispatchEvent(new Event("resize"))).observe(box);
    box.tabIndex = 0;
    if (!scene.controls) return;
    scene.controls.keyRotateSpeed = 4;
    scene.controls.listenToKeyEvents(box);
}"""
"""By itself a scene follows the window, and not what lies beside it, as the drawer does; and it hears no keys."""


def scene_box(label: str) -> ui.scene:
    """A scene that says what it shows, in the place where it is created."""
    scene = ui.scene(grid=False, background_color="#0b0f14", fps=15).classes("scene-box")
    scene.on("init", js_handler=_BEGIN % scene.id)
    return scene.props(f'role=img aria-label="{label}"')
