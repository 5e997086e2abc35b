"""Which calibration is the current one, whoever chooses it at the same time."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from server.lab.calibrations import CalibrationStore


def store_of(folder: Path) -> CalibrationStore:
    store = CalibrationStore(folder)
    for name in "ab":
        store.path(name).write_text("{}")
    return store


def test_several_who_choose_at_once_do_not_take_the_file_from_each_other(tmp_path: Path) -> None:
    store = store_of(tmp_path)
    with ThreadPoolExecutor(8) as threads:
        list(threads.map(store.choose, "ab" * 100))
    assert store.current in ("a", "b")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "b.json", "current"]
