"""DeskPage: what the desk asks of every page."""

from typing import Protocol


class DeskPage(Protocol):
    """A page between the bar and the rail; its elements are made where it is created."""

    async def refresh(self) -> None:
        """Follow the rig; called four times a second while the page is shown."""

    async def reload(self) -> None:
        """Read lists again: of runs, jobs and calibrations; called at first, and whenever one of them has changed."""
