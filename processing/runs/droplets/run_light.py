"""Which light a run is in, asked of its first shots: where a shot has few droplets, those of several vote together.

Lens and lamp are the same in all shots of a run; so whatever light the droplets of some shots show is that of all.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from daq.files.run_directory import ImageKey, RunReader, Shot, ShotFileError
from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.shadows.light.fringes import together
from processing.analysis.droplets.shadows.light.light_search import Relit, seen_light
from processing.analysis.droplets.shadows.light.seen_light import SeenLight
from processing.analysis.droplets.shadows.shadow_finder import find_shadows
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions
from processing.analysis.droplets.shadows.shadow_rounds import ShadowRounds
from processing.analysis.droplets.shadows.shadow_shot import looking, unmeasurable
from processing.preprocessing import Intensity
from processing.runs.measured_images import shadow_images, without_ignored
from processing.runs.results_file import FrameName
from processing.runs.workbench import References

ENOUGH, MOST_SHOTS = 30, 8
"""Droplets that vote together, and exposures that are searched for them: images of all of these are held at once."""
_Seen = list[tuple[ShadowRounds, ShadowFit]]


class RunLight:
    """The light of a run of shadows; what its shots have told is kept.

    Parameters
    ----------
    run, search, references : RunReader, DropletSearch, References
        Whose shots, where droplets are looked for, and the run's references.
    ignored : sequence of IgnoredPixels
        What is not asked.
    """

    def __init__(self, run: RunReader, search: DropletSearch, references: References, ignored: Sequence[str]) -> None:
        self._run, self._search, self._references, self._ignored = run, search, references, ignored
        self._known: SeenLight | None = None
        self._asked: list[int] = []

    def seen(self, threads: int, before_round: Callable[[], None]) -> SeenLight | None:
        """What exposures A of the first shots say together; asked again where they did not tell and more have come."""
        shots = self._shots()
        if self._known is None and self._asked != shots:
            self._known = _common_light(self._exposures(shots, threads), self._search, before_round)
            self._asked = shots
        return self._known

    def _shots(self) -> list[int]:
        samples = np.flatnonzero(self._run.image_keys() == ImageKey.SAMPLE)
        return list(map(int, samples[:MOST_SHOTS]))

    def _exposures(self, shots: Sequence[int], threads: int) -> Iterator[Transmissions]:
        for index in shots:
            with suppress(ShotFileError):  # whoever asks for that one is told
                if not (shot := self._run.read_shot(index)).valid:
                    continue
                images, trust = known_shadows(self._run, shot, "a", self._references, self._ignored)
                if not unmeasurable(images, trust, self._search):
                    yield looking(images, trust, self._search, threads)


def known_shadows(
    run: RunReader, shot: Shot, frame: FrameName, references: References, ignored: Sequence[str]
) -> tuple[list[Intensity], list[Intensity]]:
    """Transmissions of one exposure, and how sure each pixel is: 0 where it is not asked."""
    images, trust = shadow_images(run, shot, frame, references)
    return images, list(without_ignored(dict(zip(shot.views, trust, strict=True)), ignored).values())


def _common_light(
    shots: Iterable[Transmissions], search: DropletSearch, before_round: Callable[[], None]
) -> SeenLight | None:
    """The light that most of their droplets show, sure as if it were stated; None where they do not tell."""
    seen = _found(shots, search, before_round)
    if not seen:
        return None

    def in_light(condenser_ratio: float | None) -> Relit:
        relit = [finder.in_light(fit, condenser_ratio) for finder, fit in seen]
        squares, radii = np.hstack([(one.squares, one.radii) for one in relit])
        return Relit(squares, radii, together(one.fringes for one in relit))

    light = seen_light(in_light, resolved=all(finder.resolves_light(fit) for finder, fit in seen))
    return None if light.doubts(_droplets(seen)) else replace(light, share=1.0)


def _found(shots: Iterable[Transmissions], search: DropletSearch, before_round: Callable[[], None]) -> _Seen:
    """Exposures with their droplets behind a Gaussian blur; those without any tell nothing."""
    seen: _Seen = []
    for shot in shots:
        fit = find_shadows(shot, search, "gaussian", before_round)
        if len(fit.discs):
            seen.append((ShadowRounds(shot, search, before_round), fit))
        if _droplets(seen) >= ENOUGH:
            break
    return seen


def _droplets(seen: _Seen) -> int:
    return sum(len(fit.discs) for _, fit in seen)
