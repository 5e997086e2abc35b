"""What becomes of a run whose disk fails: real, small file systems, see ``tests.support.storage_trials``."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.storage_trials import DISK_BYTES, MARGIN_BYTES

ROOT = Path(__file__).parents[3]
NAMESPACE = ("unshare", "-rm", "setpriv", "--bounding-set", "-dac_override,-dac_read_search")


def namespace_works() -> bool:
    return subprocess.run([*NAMESPACE, "true"], capture_output=True, check=False).returncode == 0


pytestmark = pytest.mark.skipif(not namespace_works(), reason="this machine forbids user namespaces")


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What was found in every trial, by its name."""
    folder = tmp_path_factory.mktemp("trials")
    process = subprocess.run(
        [*NAMESPACE, sys.executable, "-m", "tests.support.storage_trials", str(folder)],
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
        cwd=ROOT,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )
    assert process.returncode == 0, process.stderr
    found = [json.loads(line) for line in process.stdout.splitlines()]
    return {one["trial"]: one for one in found}


CAUSES = {
    "filled_by_the_run": "the disk of {run_dir} has ",
    "filled_by_others": "the disk of {run_dir} ",
    "moved": "{run_dir} is gone (moved, deleted, or its disk is not mounted): bring it back",
    "unmounted": "{run_dir} is gone (moved, deleted, or its disk is not mounted): bring it back",
    "read_only_for_a_while": "the disk of {run_dir} is read-only, as after a fault of it: look at it, mount it",
    "forbidden_for_a_while": "{run_dir} may not be written by this server (user 0): give the permission back",
}

CODES = {
    "filled_by_the_run": "disk_full",
    "filled_by_others": "disk_full",
    "moved": "disk_gone",
    "unmounted": "disk_gone",
    "read_only_for_a_while": "disk_read_only",
    "forbidden_for_a_while": "disk_forbidden",
}


@pytest.mark.parametrize("name", CAUSES)
def test_light_goes_off_first_and_outcome_and_cause_are_stored(trials: dict[str, dict[str, Any]], name: str) -> None:
    found = trials[name]
    assert found["light_first"]
    cause, code = found["closing"]["cause"], CODES[name]
    assert found["codes"] == [code]
    assert found["closing"]["outcome"] == found["status"]["outcome"] == "failed"
    assert cause == found["status"]["message"]
    shot, reason = cause.split(" cannot be stored: ")
    assert int(shot.removeprefix("shot ")) in found["unstored"]
    assert reason.startswith(CAUSES[name].format(run_dir=found["run_dir"]))
    assert ("delete or move away what is not needed" in reason) == name.startswith("filled")
    assert cause.endswith("then start again")
    assert "rrno" not in cause, "numbers of the system help no operator"
    assert found["readable"] == found["acknowledged"] >= 3
    assert [*range(found["acknowledged"]), *found["unstored"]] == list(range(found["fired"]))
    assert found["parts"] == []


def test_no_run_starts_on_the_disk_that_lies_below_one_that_is_gone(trials: dict[str, dict[str, Any]]) -> None:
    found = trials["unmounted"]
    data_dir = Path(found["run_dir"]).parent
    assert found["refused"].startswith(f"{data_dir} is gone, or another folder or disk has taken its place")
    assert found["left_behind"] == []


def test_a_run_ends_at_the_margin_and_not_at_the_last_byte(trials: dict[str, dict[str, Any]]) -> None:
    found = trials["filled_by_the_run"]
    assert MARGIN_BYTES / 2 < found["free"] < DISK_BYTES / 2
    assert f"a run leaves {MARGIN_BYTES} bytes free" in found["closing"]["cause"]


@pytest.mark.parametrize("name", ["read_only_for_a_while", "forbidden_for_a_while"])
def test_an_outcome_that_cannot_be_written_is_kept_until_it_can(trials: dict[str, dict[str, Any]], name: str) -> None:
    found = trials[name]
    assert found["before"] is None
    refused = "its outcome could not be written, that is tried until the disk takes it: "
    why = CAUSES[name].format(run_dir=found["run_dir"])
    assert any(text.startswith(refused + why) for text in found["messages"])
    assert found["messages"][-1] == "its outcome is in its file now: failed"


def test_an_outcome_that_was_never_written_lies_beside_the_run(trials: dict[str, dict[str, Any]]) -> None:
    found = trials["forbidden_until_the_end"]
    assert found["closing"] is None
    assert (found["note"]["outcome"], found["note"]["cause"]) == ("failed", found["status"]["message"])
