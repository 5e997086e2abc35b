"""ControlChip: who holds control of the rig; a click takes it, gives it back, says one's name, or signs out."""

from nicegui import ui

from server.lab.desk.control import Holder
from server.lab.desk.visitor import Role, Visitor
from server.lab.errors import ServerError
from server.lab.services import Context
from server.web.api.sign_in import SIGN_OUT_PATH
from server.web.ui.visiting import rename, told, visitor


class ControlChip:
    """Built once per tab, refreshed by its timer."""

    def __init__(self, context: Context) -> None:
        self._control = context.control
        self._has_tokens = context.services.config.server.token is not None
        self._shown = ""
        self._was_mine = False
        with ui.button(color=None).props("flat dense no-caps").classes("control-chip lockable") as self._chip:
            ui.icon("back_hand", size="18px")
            self._text = ui.label("").classes("control-text")
            self._add_menu()

    def refresh(self) -> None:
        """Show what has changed, and say so if somebody has taken control from this tab."""
        holder, who = self._control.holder, visitor()
        is_mine = holder is not None and holder.who.id == who.id
        if self._was_mine and holder is not None and not is_mine:
            ui.notify(f"{holder.who.name} has taken control", type="warning", timeout=0, close_button="OK")
        self._was_mine = is_mine
        text = _control_text(holder, who)
        if text != self._shown:
            self._shown = text
            self._text.set_text(text)
            self._chip.props["aria-label"] = f"control: {text}"
            self._chip.update()
        self._show_menu(holder, who, is_mine)

    def _add_menu(self) -> None:
        with (
            ui.menu().props('role=region aria-label="control of the rig"') as self._menu,
            ui.column().classes("q-pa-md gap-2").style("width:min(340px, 90vw)"),
        ):
            self._about = ui.label("").classes("text-sm").props("role=status")
            self._take = ui.button("Take control", icon="back_hand", on_click=self._on_take).classes("w-full")
            self._give = ui.button("Give control back", on_click=self._on_give).props("outline").classes("w-full")
            self._name = ui.input("Your name", value=visitor().name).props("dense outlined maxlength=40")
            self._name.classes("w-full").on("keydown.enter", self._on_name).on("blur", self._on_name)
            if self._has_tokens:
                with ui.element("form").props(f"method=post action={SIGN_OUT_PATH}").classes("w-full"):
                    ui.button("Sign out", icon="logout").props("type=submit outline").classes("w-full")

    def _show_menu(self, holder: Holder | None, who: Visitor, is_mine: bool) -> None:
        self._about.set_text(about(holder, who, is_mine))
        self._take.set_visibility(not is_mine and who.role is Role.OPERATOR)
        self._give.set_visibility(is_mine)
        self._name.set_visibility(who.role is Role.OPERATOR)

    def _on_take(self) -> None:
        try:
            self._control.take(visitor())
        except ServerError as error:
            ui.notify(told(error), type="negative")
        else:
            self._menu.close()  # it may lie over what was to be pressed

    def _on_give(self) -> None:
        self._control.release(visitor())

    def _on_name(self) -> None:
        named, holder = rename(self._name.value or ""), self._control.holder
        self._name.set_value(named.name)
        if holder is not None and holder.who.id == named.id:
            self._control.take(named)


def _control_text(holder: Holder | None, who: Visitor) -> str:
    """What the bar says, in a word or two."""
    if who.role is Role.VIEWER:
        return "viewer"
    if holder is None:
        return "free"
    return "you" if holder.who.id == who.id else holder.who.name


def about(holder: Holder | None, who: Visitor, is_mine: bool) -> str:
    """The same in a sentence."""
    if holder is None:
        return "Nobody holds control: whoever makes light or changes something first holds it. ABORT needs none."
    minutes = max(1, round(holder.left_s / 60))
    if is_mine:
        return f"You, {who.name}, hold control until {minutes} min after your last action; a run keeps it."
    return f"{holder.who.name} holds control, for {minutes} min more if nothing is done. ABORT needs none."
