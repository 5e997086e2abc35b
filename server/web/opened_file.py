"""OpenedFile: a file that is sent as it was when it was opened, whole, whoever deletes or replaces it meanwhile."""

import os
from pathlib import Path
from typing import BinaryIO

from fastapi.responses import FileResponse
from starlette.types import Receive, Scope, Send

from server.lab.errors import NotFound


class OpenedFile(FileResponse):
    """The answer to a download; closes the file.

    Parameters
    ----------
    file : BinaryIO
        An ordinary file, open for reading.
    media_type : str
        What it is.
    filename : str, optional
        How it is to be called where it is stored.
    """

    def __init__(self, file: BinaryIO, media_type: str, filename: str | None = None) -> None:
        place, state = f"/proc/self/fd/{file.fileno()}", os.fstat(file.fileno())
        super().__init__(place, media_type=media_type, filename=filename, stat_result=state)
        self._file = file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it."""
        with self._file:
            await super().__call__(scope, receive, send)


def opened_file(path: Path, media_type: str, filename: str | None = None) -> OpenedFile:
    """The answer to a download of what is there now; NotFound if it is gone."""
    try:
        return OpenedFile(path.open("rb"), media_type, filename)
    except OSError as error:
        raise NotFound(f"{path.name} is not there any more: {error.strerror}") from error
