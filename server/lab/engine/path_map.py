"""Paths as other computers call them: one folder, mounted elsewhere."""

from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

PATHS = ("run_dir", "calibration_file", "results_dir")
"""Keys of a job that hold paths."""


class PathMap:
    """What folders of this computer are called by others.

    Parameters
    ----------
    roots : mapping of str to str
        A folder here, and its name there; all else is called the same.
    """

    def __init__(self, roots: Mapping[str, str]) -> None:
        here = sorted(roots, key=lambda root: len(PurePosixPath(root).parts), reverse=True)
        self._roots = [(PurePosixPath(root), PurePosixPath(roots[root])) for root in here]

    def there(self, path: str) -> str:
        """What others call a path; the longest root that fits counts."""
        asked = PurePosixPath(path)
        for here, there in self._roots:
            if asked.is_relative_to(here):
                return str(there / asked.relative_to(here))
        return path


def as_seen_by_workers(paths: PathMap, job: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """A job with the paths of workers, and the folders that they must see, with their names here.

    The folder of results is made here: a worker that does not see it has another disk there.
    """
    here = {key: str(Path(job[key]).absolute()) for key in PATHS if job.get(key)}
    if "results_dir" in here:
        Path(here["results_dir"]).mkdir(parents=True, exist_ok=True)
    folders = {str(Path(path).parent) if key == "calibration_file" else path for key, path in here.items()}
    there = {key: paths.there(path) for key, path in here.items()}
    return {**job, **there}, {paths.there(folder): folder for folder in sorted(folders)}
