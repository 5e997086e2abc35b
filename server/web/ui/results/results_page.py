"""ResultsPage: what came of the runs: volumes, droplets, and more where it is asked for."""

import asyncio
from pathlib import Path

from nicegui import ui

from processing.analysis.droplets.droplet_file import StoredDroplets
from server.lab.droplets.measured import droplets_of
from server.lab.errors import ServerError
from server.lab.services import Context
from server.web.ui.results.droplet_panel import DropletPanel
from server.web.ui.results.droplet_table import DropletTable, dots_of
from server.web.ui.results.looked_at import LookedAt, exposures_of, method_of, set_with_droplets
from server.web.ui.results.result_choice import ResultChoice
from server.web.ui.results.volume_view import VolumeView
from server.web.ui.runs.run_work import RunWork, can_be_worked_on
from server.web.ui.runs.runs_page import STYLE_SHEET as STYLE_OF_RUNS
from server.web.ui.theme import panel

_STYLE_SHEET = Path(__file__).with_name("results.css")


class ResultsPage:
    """See ``DeskPage``.

    Parameters
    ----------
    context : Context
        The application.
    run_id, results_id, shot : str
        What the address asks for; empty where it does not say.
    """

    def __init__(self, context: Context, run_id: str = "", results_id: str = "", shot: str = "") -> None:
        for sheet in (STYLE_OF_RUNS, _STYLE_SHEET):
            ui.add_css(sheet)
        self._context = context
        with ui.element("div").classes("columns one"):
            self._choice = ResultChoice(context, (run_id, results_id, shot), self._look)
            self._volume = VolumeView(context)
            with panel("Reconstruct or measure this run") as self._work_panel:
                self._work = RunWork(context)
            self._table = DropletTable(self._volume.go_to)
            self._droplets = DropletPanel(context)

    async def refresh(self) -> None:
        """Everything here is a list."""

    async def reload(self) -> None:
        """Offer the results that exist now."""
        await self._choice.reload()
        await self._work.reload()

    async def _look(self) -> None:
        choice = self._choice
        await self._offer_work(choice.run_id)
        await self._droplets.show(choice.run_id, choice.sets)
        if (looked := choice.looked) is None or (shown := choice.shown) is None:
            await self._volume.show(LookedAt(choice.run_id, "", 0), {}, None)
            self._table.show(None, leads=False)
            choice.offer_downloads({})
            return
        names = exposures_of(shown, looked.shot)
        measured = set_with_droplets(choice.sets, shown, looked.shot)
        choice.offer_downloads(_files(looked, names, measured.id if measured else None))
        await self._volume.show(looked, names, method_of(shown))
        droplets = await asyncio.to_thread(self._read, looked, measured.id) if measured else None
        if looked == choice.looked:  # nobody has gone on meanwhile
            self._table.show(droplets, leads=bool(names))
            self._volume.mark(dots_of(droplets))

    async def _offer_work(self, run_id: str) -> None:
        try:
            run = await asyncio.to_thread(self._context.runs.summary, run_id) if run_id else None
        except ServerError:
            run = None
        self._work.show(run)
        self._work_panel.set_visibility(run is not None and can_be_worked_on(run))

    def _read(self, looked: LookedAt, results_id: str) -> StoredDroplets | None:
        try:
            return droplets_of(self._context.runs.directory(looked.run_id) / "results" / results_id, looked.shot)
        except ServerError:
            return None  # the table of the run says what is wrong with it


def _files(looked: LookedAt, names: dict[str, str], measured: str | None) -> dict[str, str]:
    """What can be downloaded of a shot, by label."""
    folder = f"/api/runs/{looked.run_id}/results"
    files = {
        f"Volume {frame.upper()} for ParaView (VTKHDF)": f"{folder}/{looked.results_id}/{name}/volume.vtkhdf"
        for frame, name in sorted(names.items())
    }
    if measured:
        files["Droplets (HDF5)"] = f"{folder}/{measured}/droplets/{looked.shot}.h5"
    return files
