"""Rail: the pages in the order of the day, each with its address, and a tick where its work is done."""

from collections.abc import Callable
from dataclasses import dataclass

from nicegui import ui

from daq.run.state import RunOutcome
from server.lab.duty import Health
from server.lab.jobs.job import JobKind, JobState
from server.lab.services import Context


@dataclass(frozen=True)
class Stop:
    """A page on the rail.

    Attributes
    ----------
    path, title, icon : str
        Where it is, what it is called, how it looks.
    is_done : Callable[[Context], bool]
        Whether what it is for is done; asked four times a second for each tab.
    done : str
        What its tick says.
    """

    path: str
    title: str
    icon: str
    is_done: Callable[[Context], bool]
    done: str


def _has_good_lamps(context: Context) -> bool:
    return all(lamp.health is Health.OK for lamp in context.lamps)


def _has_seen_every_view(context: Context) -> bool:
    shot = context.services.acquisition.newest_shot
    return shot is not None and shot.valid


def _is_calibrated(context: Context) -> bool:
    current = context.calibrations.current
    return current is not None and context.calibrations.made_s(current) is not None


def _has_completed_a_run(context: Context) -> bool:
    return context.services.acquisition.status().outcome is RunOutcome.COMPLETED


def _has_results_of_the_last_run(context: Context) -> bool:
    run_id = context.services.acquisition.status().run_id
    made = (JobKind.RECONSTRUCTION, JobKind.MEASUREMENT)
    return run_id is not None and bool(context.jobs.newest(run_id, [JobState.DONE], 1, made))


def _is_the_last_run_stored(context: Context) -> bool:
    status = context.services.acquisition.status()
    return status.outcome is not None and status.run_id is not None and context.runs.has(status.run_id)


STOPS = (
    Stop("/rig", "Rig", "precision_manufacturing", _has_good_lamps, "every device answers"),
    Stop("/live", "Live", "videocam", _has_seen_every_view, "the newest picture of every view came whole"),
    Stop("/calibrate", "Calibrate", "straighten", _is_calibrated, "a calibration is chosen"),
    Stop("/run", "Run", "play_circle", _has_completed_a_run, "the last run is complete"),
    Stop("/results", "Results", "view_in_ar", _has_results_of_the_last_run, "the last run has volumes or droplets"),
    Stop("/runs", "Runs", "list_alt", _is_the_last_run_stored, "the last run has ended and is stored"),
)


class Rail:
    """Built once per tab, refreshed by its timer."""

    def __init__(self, context: Context) -> None:
        self._context = context
        with ui.element("nav").classes("rail").props('aria-label="pages"'):
            self._links = {stop.path: ui.link(target=stop.path).classes("rail-stop") for stop in STOPS}
            self._ticks = {stop: _fill(self._links[stop.path], stop) for stop in STOPS}
            ui.space()
            self.drawer_button = ui.button(icon="receipt_long").classes("rail-drawer")
            self.drawer_button.props('flat no-caps stack aria-label="jobs and events"')
            with self.drawer_button:
                ui.label("Jobs")
        self.refresh()

    def mark(self, path: str) -> None:
        """Show which page is open."""
        for own, link in self._links.items():
            if path == own:
                link.props("aria-current=page")
            else:
                link.props(remove="aria-current")

    def refresh(self) -> None:
        """Show what is done."""
        for stop, tick in self._ticks.items():
            tick.set_visibility(stop.is_done(self._context))


def _fill(link: ui.link, stop: Stop) -> ui.icon:
    with link.props(f'aria-label="{stop.title}"'):
        ui.icon(stop.icon, size="22px")
        ui.label(stop.title)
        tick = ui.icon("check_circle", size="14px").classes("rail-tick").props(f'aria-label="done: {stop.done}"')
        return tick.tooltip(f"Done: {stop.done}")
