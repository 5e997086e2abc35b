"""TemplateBar: load the form from a template, or keep it as one."""

from collections.abc import Callable

from nicegui import ui

from daq.errors import DaqError
from server.lab.errors import ServerError
from server.web.ui.draft import DraftStore
from server.web.ui.run.templates import TemplateStore
from server.web.ui.sure import is_sure
from server.web.ui.visiting import for_operators, require_operator, told


class TemplateBar:
    """Built once per page.

    Parameters
    ----------
    templates : TemplateStore
        All of this rig.
    draft : DraftStore
        The form.
    show : Callable[[], None]
        Shows a draft that has changed.
    """

    def __init__(self, templates: TemplateStore, draft: DraftStore, show: Callable[[], None]) -> None:
        self._templates, self._draft, self._show = templates, draft, show
        with ui.row().classes("w-full gap-2 items-center no-wrap"):
            self._chosen = ui.select([], label="Template", on_change=self._on_choose).classes("grow")
            self._chosen.props('dense outlined options-dense aria-label="Template"')
            self._keep = ui.button(icon="save_as").props('flat dense round aria-label="keep as a template"')
            with self._keep:
                ui.tooltip("Keep this form as a template, or remove one")
                self._add_menu()
        self.reload()

    def reload(self) -> None:
        """Offer the templates that there are."""
        self._chosen.set_options(self._templates.names())

    def allow(self, why: str) -> None:
        """Nobody fills the form while somebody else holds control; why, where that is so."""
        for_operators(self._chosen, why=why)
        for_operators(self._keep, why=why)

    def _add_menu(self) -> None:
        with ui.menu() as self._menu, ui.column().classes("q-pa-md gap-2").style("width:260px"):
            self._name = ui.input("Save as").props("dense outlined").classes("w-full")
            ui.button("Save template", on_click=self._on_save).classes("w-full")
            ui.button("Remove the chosen one", on_click=self._on_remove).props("outline no-caps").classes("w-full")

    def _on_choose(self) -> None:
        for name, value in self._templates.load(self._chosen.value or "").items():
            if name in self._draft.values and value != self._draft.values[name]:
                self._draft.set(name, self._with_every_view(value) if name == "current_a" else value)
        self._show()

    def _with_every_view(self, stored: dict[str, float | None]) -> dict[str, float | None]:
        known: dict[str, float | None] = self._draft.values["current_a"]
        return {view: stored.get(view, current_a) for view, current_a in known.items()}

    async def _on_save(self) -> None:
        name = (self._name.value or "").strip()
        try:
            require_operator()
            if name in self._templates.names() and not await is_sure(f"Replace the template {name}?", "Replace"):
                return
            self._templates.save(name, self._draft.values)
        except (DaqError, ServerError, OSError) as error:
            ui.notify(told(error), type="negative")
        else:
            self._menu.close()
            self.reload()

    async def _on_remove(self) -> None:
        name = self._chosen.value
        if not name:
            ui.notify("Choose a template first", type="warning")
            return
        try:
            require_operator()
            if not await is_sure(f"Remove the template {name}?", "Remove"):
                return
            self._templates.remove(name)
        except (ServerError, OSError) as error:  # a disk that is only read, say
            ui.notify(told(error), type="negative")
        else:
            self.reload()
