"""What the doctor says of the computer: sound ones, and what is missing."""

import json
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from server.cli.main import main
from server.doctor import doctor_host
from server.doctor.checkup import Checkup, Status


def test_without_configuration_the_computer_is_looked_at(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) == 0
    output, progress = capsys.readouterr()
    checks = json.loads(output.splitlines()[-1])["checks"]
    names = [check["name"] for check in checks]
    assert names == ["host", "python packages", "aravis", "kernels", "user namespaces", "receive buffer", "disk"]
    for check in checks:
        assert set(check) == {"name", "status", "detail", "remedy"}
        assert check["detail"]
        assert check["status"] in ("ok", "warn")
        assert (check["status"] == "ok") == (check["remedy"] == "")
        assert check["name"] in progress


def test_a_wrong_configuration_fails_and_the_computer_is_looked_at_all_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "rig.toml"
    config.write_text('name = "rig"\n[views]\n')
    assert main(["doctor", "--config", str(config), "--json"]) == 1
    result = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert not result["passed"]
    assert (result["checks"][0]["name"], result["checks"][0]["status"]) == ("configuration", "fail")
    assert str(config) in result["checks"][0]["detail"]
    assert result["checks"][-1]["name"] == "disk"


@pytest.mark.parametrize(("held_bytes", "status"), [(212992, Status.WARN), (4194304, Status.OK)])
def test_a_small_receive_buffer_is_told_with_the_command_that_mends_it(
    held_bytes: int, status: Status, tmp_path: Path
) -> None:
    file = tmp_path / "rmem_max"
    file.write_text(f"{held_bytes}\n")
    check = doctor_host.check_receive_buffer(file)
    assert check.status is status
    assert str(held_bytes) in check.detail
    assert ("net.core.rmem_max=4194304" in check.remedy) is (status is Status.WARN)


def test_a_receive_buffer_that_cannot_be_read_is_a_warning(tmp_path: Path) -> None:
    assert doctor_host.check_receive_buffer(tmp_path / "none").status is Status.WARN


def test_the_disk_of_a_folder_that_does_not_exist_yet_is_that_of_its_parent(tmp_path: Path) -> None:
    check = doctor_host.check_disk(tmp_path / "runs" / "of" / "tomorrow")
    assert check.status is not Status.FAIL
    assert check.detail.startswith(f"{tmp_path}: ")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_takes_nothing_fails() -> None:
    check = doctor_host.check_disk(Path("/proc/self"))
    assert check.status is Status.FAIL
    assert "server.data_dir" in check.remedy


def test_missing_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        if name in ("h5py", "distributed"):
            raise PackageNotFoundError(name)
        return "1"

    monkeypatch.setattr(doctor_host, "version", version)
    missing = Checkup("python packages", Status.FAIL, "missing: distributed, h5py", "make setup")
    assert doctor_host.check_packages() == missing
