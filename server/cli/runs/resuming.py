"""What an interrupted command leaves, and how to go on."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from server.cli.output import progress


@contextmanager
def resumable(out: Path, shots: Sequence[int], files: Callable[[int], Sequence[Path]]) -> Iterator[None]:
    """Where work on shots is interrupted, say which ``--shots`` are left; a shot of which a file is missing is one."""
    try:
        yield
    except KeyboardInterrupt:
        left = [shot for shot in shots if not all(file.exists() for file in files(shot))]
        for file in files(left[0]) if left else ():
            file.unlink(missing_ok=True)
        if 0 < len(left) < len(shots):
            done = len(shots) - len(left)
            progress(f"{out}: keeps {done} shots of {len(shots)}; go on with --shots {left[0]}:{shots[-1] + 1}")
        raise
