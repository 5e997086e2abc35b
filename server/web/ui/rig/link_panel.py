"""LinkPanel: what the plan of the form takes of the wires between cameras and computer, as a bar per wire."""

from nicegui import ui

from server.lab.devices.link_budget import link_budget
from server.lab.services import Context
from server.lab.starting.preflight_list import percent
from server.web.ui.draft import DraftStore
from server.web.ui.theme import panel


class LinkPanel:
    """Built once per page, refreshed by its timer."""

    def __init__(self, context: Context, draft: DraftStore) -> None:
        rig = context.services.rig
        self._draft = draft
        self._shown: float | None = None
        self._budget = budget = link_budget(rig.network, rig.cameras)
        self._bars: list[tuple[float, ui.linear_progress, ui.label]] = []
        with panel("Network"):
            self._told = ui.label("").classes("text-sm").props('role=status aria-label="link budget"')
            with ui.grid(columns="auto minmax(60px,1fr) auto").classes("w-full items-center link-bars"):
                for view, link in budget.cameras.items():
                    self._add_bar(
                        view, f"{link.shot_bytes / 1e6:.1f} MB at {budget.camera_gbit_s:g} Gbit/s", link.wire_s
                    )
                if budget.shared_s is not None:
                    self._add_bar("all", f"shared, {budget.shared_gbit_s:g} Gbit/s", budget.shared_s)
            ui.label(f"Stream packets of {budget.packet_bytes} bytes; [network] in the rig file").classes(
                "text-xs opacity-70"
            )
        self.refresh()

    def refresh(self) -> None:
        """Follow the rate of the form."""
        rate_hz = self._draft.values["rate_hz"] or 0.0
        if rate_hz == self._shown:
            return
        self._shown = rate_hz
        most_hz, limit = self._budget.most_hz, self._budget.limited_by
        fits = f"The run form asks for {rate_hz:g} shots/s. At most {most_hz:.3g} pass: the limit is {limit}."
        self._told.set_text(fits if rate_hz <= most_hz else f"{fits} Lower the rate, or give the cameras more network.")
        self._told.classes(add="refusal" if rate_hz > most_hz else "", remove="" if rate_hz > most_hz else "refusal")
        for wire_s, bar, text in self._bars:
            share = rate_hz * wire_s
            bar.set_value(min(share, 1.0))
            bar.props(f"color={'negative' if share > 1 else 'primary'}")
            text.set_text(percent(share))

    def _add_bar(self, name: str, what: str, wire_s: float) -> None:
        with ui.column().classes("gap-0"):
            ui.label(name)
            ui.label(what).classes("text-xs opacity-70")
        bar = ui.linear_progress(0, show_value=False, size="10px").props(f'rounded aria-label="wire of {name}"')
        text = ui.label("").classes("text-right")
        self._bars.append((wire_s, bar, text))
