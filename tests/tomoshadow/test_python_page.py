"""``docs/python.md`` says what happens: it is run as it stands."""

import doctest
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "python.md"
OLD_RUNS = ROOT / "tests" / "fixtures" / "v0.1.0" / "runs"


@pytest.mark.timeout(900)  # 20 s of CPU time
def test_the_page_runs_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    data = {
        "RUN": str(OLD_RUNS / "20261128T090938-spray"),
        "CALIBRATION": OLD_RUNS / "calibrations" / "20261128T090811-target-pinhole.json",
    }
    assert "SKIP" not in PAGE.read_text(encoding="utf-8")
    results = doctest.testfile(str(PAGE), module_relative=False, globs=data, encoding="utf-8")
    assert results.attempted >= 20
    assert results.failed == 0
    assert {path.name for path in tmp_path.iterdir()} == {"shot.vtkhdf", "shot.png"}
