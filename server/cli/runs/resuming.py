"""What an interrupted command leaves, and how to go on."""

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from daq.counted import counted
from daq.files.atomic_file import PART_SUFFIX
from server.cli.output import progress


@contextmanager
def resumable(out: Path, shots: Sequence[int], files: Callable[[int], Sequence[Path]]) -> Iterator[None]:
    """Where work on shots ends early, say which ``--shots`` are left: all from the first on of which a file is missing.

    What there is of them is removed: on other computers a later shot may be done before an earlier one.
    """
    try:
        yield
    except BaseException:
        done = next((number for number, shot in enumerate(shots) if not _is_whole(files(shot))), len(shots))
        for file in _all_files(shots[done:], files):
            file.unlink(missing_ok=True)
        if 0 < done < len(shots):
            go_on = f"--shots {shots[done]}:{shots[-1] + 1}"
            progress(f"{out}: keeps {counted(done, 'shot')} of {len(shots)}; go on with {go_on}")
        raise
    finally:
        _remove_parts(out, {file.name for file in _all_files(shots, files)})


def _all_files(shots: Sequence[int], files: Callable[[int], Sequence[Path]]) -> Iterator[Path]:
    return (file for shot in shots for file in files(shot))


def _is_whole(files: Sequence[Path]) -> bool:
    return all(file.exists() for file in files)


def _remove_parts(out: Path, names: Collection[str]) -> None:
    """What workers left that were killed; one that is out of reach and still writes cannot finish its file."""
    for part in out.glob(f"*{PART_SUFFIX}"):
        if part.name.rsplit(".", 2)[0] in names:
            part.unlink(missing_ok=True)
