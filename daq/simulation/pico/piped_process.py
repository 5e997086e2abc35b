"""A process that is told by a pipe what to do, and tells by another one what happens, line by line."""

import subprocess
from collections.abc import Iterator, Sequence


def start_piped(command: Sequence[str], *files: int) -> subprocess.Popen[str]:
    """Start it, with these open files. Ctrl-C is for us alone: it ends with its pipe, once the light is off."""
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, pass_fds=files, start_new_session=True)


def lines_of(process: subprocess.Popen[str]) -> Iterator[str]:
    """What it tells until it ends."""
    if process.stdout is not None:
        for line in process.stdout:
            yield line.rstrip("\n")
