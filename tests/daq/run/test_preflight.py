"""What a start reads from the disk: a run of references, a calibration, each once."""

from pathlib import Path
from typing import Any

import pytest

from daq.files.run_directory import RunKind, RunReader
from daq.run.references import find_references
from tests.daq.run.test_acquisition import DEADLINE_S, Laboratory, plan_of


def test_a_start_reads_references_and_calibration_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A calibration has megabytes, and the references of a day lie on a disk of the network."""
    lab, read = Laboratory(tmp_path / "runs"), list[str]()

    def hashed(name: str) -> str:
        read.append(name)
        return "its hash"

    def found(*given: Any) -> Any:
        read.append("references")
        return find_references(*given)

    monkeypatch.setattr(lab.acquisition, "_hash_calibration", hashed)
    monkeypatch.setattr("daq.run.preflight.find_references", found)
    with lab.acquisition as acquisition:
        dark = lab.run(plan_of(1, kind=RunKind.DARK)).run_dir.name
        read.clear()
        run_id = acquisition.start(plan_of(1, references=(dark,), calibration="c7"))
        assert not acquisition.wait(DEADLINE_S).active
    assert sorted(read) == ["c7", "references"]
    assert RunReader(lab.data_dir / run_id).header.calibration_sha256 == "its hash"
