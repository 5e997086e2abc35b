"""Which image is which exposure of a run: what a manifest states shot by shot, and what its patterns stand for."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq.files.run_directory import ImageKey
from processing.count import counted
from processing.image_file import ImageFileError, page_count
from processing.kernels import _native
from processing.runs.manifest.image_pattern import ImagePattern
from processing.runs.manifest.import_manifest import Manifest, ManifestFile, RunEntry, ShotEntry, ShotsEntry
from processing.runs.toml_lines import Key

_KINDS = (
    ("shot", "shots", ImageKey.SAMPLE),
    ("background", "backgrounds", ImageKey.BACKGROUND),
    ("dark", "darks", ImageKey.DARK),
)
_FRAMES = ("frame_a", "frame_b")


@dataclass(frozen=True)
class ImageSource:
    """One image: the key that names it, its file, and which image of a stack it is."""

    key: Key
    file: str
    page: int | None = None


@dataclass(frozen=True)
class ShotSource:
    """One shot: what it is, and the images of every camera, exposure A and, where it has a file of its own, B."""

    image_key: ImageKey
    frames: tuple[Mapping[str, ImageSource], ...]


def shot_sources(source: ManifestFile, run: RunEntry) -> list[ShotSource]:
    """All shots of a run, then its backgrounds and darks, in the order of the manifest.

    Raises
    ------
    ManifestError
        A pattern fits no file, cameras differ, or their counts of images do; names the line.
    """
    shots = list(_all_shots(source, run))
    cameras = set(shots[0].frames[0])
    if not 2 <= len(cameras) <= _native.MAX_VIEWS:
        raise source.error(("run",), f"{len(cameras)} cameras, a run has 2 to {_native.MAX_VIEWS}")
    for shot in shots:
        for images in shot.frames:
            if set(images) != cameras:
                key = next(iter(images.values())).key[:-1]
                raise source.error(key, f"cameras {_names(images)} differ from {_names(cameras)}")
    return shots


def _all_shots(source: ManifestFile, run: RunEntry) -> Iterator[ShotSource]:
    for kind, kinds, image_key in _KINDS:
        for number, entry in enumerate(getattr(run, kind)):
            yield ShotSource(image_key, _stated(("run", kind, number), entry))
        for number, entry in enumerate(getattr(run, kinds)):
            for frames in _by_pattern(source, ("run", kinds, number), entry):
                yield ShotSource(image_key, frames)


def _stated(key: Key, entry: ShotEntry) -> tuple[dict[str, ImageSource], ...]:
    return tuple(
        {camera: ImageSource((*key, name, camera), file, page) for camera, file in images.items()}
        for name, images, page in zip(_FRAMES, entry.frames, _pages(entry), strict=False)
    )


def _pages(entry: ShotEntry | ShotsEntry) -> tuple[int | None, int | None]:
    return entry.page, entry.page if entry.page_b is None else entry.page_b


def _by_pattern(source: ManifestFile, key: Key, entry: ShotsEntry) -> Iterator[tuple[dict[str, ImageSource], ...]]:
    first, pattern = next(iter(entry.patterns.items()))
    views = entry.views or _other_views(source.manifest)
    found = {} if views and entry.shots else _found(source, (*key, first), pattern, views)
    views = views or tuple(found)
    if entry.counts_shots:
        shots, starts, step = _numbers(source, key, entry, views, found), _pages(entry), 0
    else:
        step = 2 if entry.frame_b is not None and entry.frame_b == entry.frame_a else 1
        shots, starts = _numbers_in_stacks(source, key, entry, views, step), (0, step - 1)
    if not views or not shots:
        raise source.error((*key, first), f"{source.resolve(pattern.text)}: no file has such a name")
    for shot in shots:
        yield tuple(
            {
                view: ImageSource(
                    (*key, name, view), pattern.file(view, shot), None if page is None else page + step * shot
                )
                for view in views
            }
            for (name, pattern), page in zip(entry.patterns.items(), starts, strict=False)
        )


def _found(source: ManifestFile, key: Key, pattern: ImagePattern, views: Sequence[str]) -> Mapping[str, Sequence[int]]:
    """Numbers of the shots of views, or of all that there are."""
    try:
        return pattern.found(source.root, views or None)
    except ValueError as error:
        raise source.error(key, str(error)) from error


def _other_views(manifest: Manifest) -> tuple[str, ...]:
    """Cameras that the manifest names elsewhere: in a shot, else in its calibration."""
    if manifest.run is not None and manifest.run.shot:
        return tuple(manifest.run.shot[0].frame_a)
    return () if manifest.calibration is None else manifest.calibration.cameras


def _numbers(
    source: ManifestFile, key: Key, entry: ShotsEntry, views: Sequence[str], found: Mapping[str, Sequence[int]]
) -> Sequence[int]:
    """Numbers of the shots that are stated, or that are there, the same for all views."""
    if entry.shots is not None:
        return range(entry.shots[0], entry.shots[1] + 1)
    of_b = [_found(source, (*key, name), pattern, views) for name, pattern in list(entry.patterns.items())[1:]]
    every = sorted({shot for one in (found, *of_b) for view in views for shot in one.get(view, ())})
    for view in views:
        numbers = found.get(view, ())
        if missing := sorted(set(every).difference(numbers)):
            fullest = max(found, key=lambda name: len(found[name]))
            counts = f"{view} has {counted(len(numbers), 'image')}, {fullest} has {len(found[fullest])}"
            raise source.error((*key, next(iter(entry.patterns))), f"{counts}: shot {missing[0]} of {view} is missing")
    if len(np.unique(np.diff(every))) > 1:
        gap = int(np.argmax(np.diff(every)))
        lost = f"shots between {every[gap]} and {every[gap + 1]} are missing of all views"
        remedy = "say shots = [first, last] of what there is, once for each part"
        raise source.error((*key, next(iter(entry.patterns))), f"{lost}; {remedy}")
    return every


def _numbers_in_stacks(
    source: ManifestFile, key: Key, entry: ShotsEntry, views: Sequence[str], pages_per_shot: int
) -> range:
    """Numbers of the shots in stacks: one per view and exposure, or one per view for both."""
    count = first = None
    for name, pattern in entry.patterns.items():
        for view in views:
            pages = _page_count(source, (*key, name, view), pattern.file(view, 0))
            count, first = count or pages, first or f"{view} has {pages} in {name}"
            if pages != count:
                raise source.error((*key, name), f"{view} has {counted(pages, 'image')}, {first}")
    if (count or 0) % pages_per_shot:
        raise source.error((*key, "frame_b"), f"{counted(count or 0, 'image')} are no pairs A, B, A, B, ...")
    there = range((count or 0) // pages_per_shot)
    if entry.shots is None:
        return there
    if entry.shots[1] not in there:
        raise source.error(
            (*key, "shots"), f"{entry.shots[1]} is beyond the {counted(len(there), 'shot')} that are there"
        )
    return there[entry.shots[0] : entry.shots[1] + 1]


def _page_count(source: ManifestFile, key: Key, file: str) -> int:
    try:
        return page_count(source.resolve(file))
    except ImageFileError as error:
        raise source.error(key, str(error)) from error


def _names(cameras: Mapping[str, object] | set[str]) -> str:
    return ", ".join(sorted(cameras))
