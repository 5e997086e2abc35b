"""Is an operator sure? Asked before something is lost that nobody can bring back."""

from nicegui import ui


async def is_sure(question: str, verb: str) -> bool:
    """Ask, and wait for the answer; whoever closes the question is not."""
    with ui.dialog() as dialog, ui.card().props('role=alertdialog aria-label="are you sure"'):
        ui.label(question).classes("text-base")
        with ui.row().classes("w-full justify-end"):
            ui.button("Keep it", on_click=lambda: dialog.submit(False)).props("flat no-caps")
            ui.button(verb, on_click=lambda: dialog.submit(True)).props("no-caps color=negative")
    try:
        return bool(await dialog)
    finally:
        dialog.delete()
