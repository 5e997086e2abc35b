"""A whole volume on request: made once, whoever asks; what goes wrong is told, and nothing is left of it."""

import asyncio
import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from daq.errors import DiskFull
from daq.files.atomic_file import own_part_path
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.volume_file import read_volume
from server.lab import runner as runner_module
from server.lab.errors import Conflict
from server.lab.results import remaking
from server.lab.tasks import reconstruct
from server.pictures.previews import load_preview, preview_path, save_preview
from tests.server.lab.test_runner import DEADLINE_S, at_work, last_until_stopped
from tests.server.lab.test_volume_parts import SETTINGS, Kept, kept_in

Task = Callable[[dict[str, Any], Callable[[], bool]], dict[str, Any]]


@pytest.fixture
def kept(tmp_path: Path) -> Kept:
    return kept_in(tmp_path)


@contextmanager
def files_end_at(size_bytes: int) -> Iterator[None]:
    """What is written beyond fails, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def left_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*.part"))


def test_who_asks_while_it_is_made_finds_it_there(kept: Kept, tmp_path: Path) -> None:
    volume = kept.made(SETTINGS)
    other = volume.with_name("shot_00000_a.vtkhdf")
    asked: list[int] = []

    def counted(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
        asked.append(job["shot"])
        return reconstruct(job, should_stop)

    async def go() -> None:
        async with at_work(tmp_path, counted) as laboratory:
            await asyncio.gather(*(laboratory.runner.store(one) for one in (volume, other, volume)))

    asyncio.run(go())
    assert asked == [0]
    assert read_volume(volume)[0].any()
    assert not (tmp_path / "unfinished_volume").exists()


@pytest.mark.parametrize(
    ("harm", "told"),
    [
        (lambda shot: shot.unlink(), "shots/0.h5: cannot be read: it is missing"),
        (lambda shot: shot.write_bytes(shot.read_bytes()[:2000]), "shots/0.h5: cannot be read: it is torn or damaged"),
    ],
)
def test_a_shot_that_cannot_be_read_any_more_is_named(
    kept: Kept, tmp_path: Path, harm: Callable[[Path], object], told: str
) -> None:
    volume = kept.made(SETTINGS)
    harm(kept.run_dir / "shots" / "0.h5")

    async def go() -> None:
        async with at_work(tmp_path, reconstruct) as laboratory:
            for _ in range(2):
                with pytest.raises(Conflict, match=rf"shot_00000_b.vtkhdf cannot be made again: .*{told}"):
                    await laboratory.runner.store(volume)

    asyncio.run(go())
    assert left_in(tmp_path) == []


def test_a_full_disk_is_told_in_words_and_keeps_no_half_of_a_volume(kept: Kept) -> None:
    settings = SETTINGS.model_copy(update={"method": ReconstructionMethod.GAVLOS, "noise_floor": 0.0})
    volume = kept.made(settings)
    again = {**remaking(volume), "calibration_file": str(kept.store.path("c"))}
    preview = preview_path(volume).read_bytes()
    with files_end_at(8000), pytest.raises(DiskFull, match=rf"the disk of {volume.parent} is full .*then start again$"):
        reconstruct(again, lambda: False)
    with files_end_at(100), pytest.raises(DiskFull, match=f"the disk of {volume.parent} is full"):
        save_preview(preview_path(volume), load_preview(preview_path(volume)))
    assert (left_in(kept.run_dir), volume.exists(), preview_path(volume).read_bytes()) == ([], False, preview)
    reconstruct(again, lambda: False)
    assert read_volume(volume)[0].any()


def test_who_waits_for_another_volume_waits_no_longer_than_for_his_own(
    kept: Kept, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    volume = kept.made(SETTINGS)
    monkeypatch.setattr(runner_module, "_STORE_S", 0.3)

    async def go() -> list[object]:
        async with at_work(tmp_path, last_until_stopped) as laboratory:
            waiting = [laboratory.runner.store(volume) for _ in range(60)]
            return list(await asyncio.gather(*waiting, return_exceptions=True))

    begun_s = time.monotonic()
    found = asyncio.run(go())
    assert [type(one) for one in found] == [Conflict] * 60
    assert time.monotonic() - begun_s < DEADLINE_S
    assert "shot_00000_b.vtkhdf took more than 0.3 s" in str(found[0])


def test_what_a_server_that_ended_left_of_a_volume_is_removed(kept: Kept, tmp_path: Path) -> None:
    volume = kept.made(SETTINGS)
    part = own_part_path(volume)

    def half(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
        part.write_bytes(b"half")
        return last_until_stopped(job, should_stop)

    async def end_meanwhile() -> None:
        async with at_work(tmp_path, half) as laboratory:
            storing = asyncio.create_task(laboratory.runner.store(volume))
            await until(part.exists)
            storing.cancel()
            await asyncio.wait([storing])

    async def begin_again() -> None:
        async with at_work(tmp_path, reconstruct):
            await until(lambda: not part.exists())

    asyncio.run(end_meanwhile())
    assert left_in(tmp_path) == [part.name]
    asyncio.run(begin_again())
    assert preview_path(volume).exists()
    assert not (tmp_path / "unfinished_volume").exists()


async def until(is_so: Callable[[], bool]) -> None:
    async with asyncio.timeout(DEADLINE_S):
        while not is_so():
            await asyncio.sleep(0.01)
