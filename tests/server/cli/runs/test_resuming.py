"""An interrupted command says what it leaves and how to go on, and it can be done."""

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.cli.main import main
from tests.support.command_line import told
from tests.support.droplet_run import write_calibration, write_run

SHOTS = 60


@pytest.fixture(autouse=True)
def interruptible() -> Iterator[None]:
    """Jobs in the background of a shell ignore SIGINT, and their children do too."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupt_once_there(file: Path, given_up: threading.Event) -> None:
    """Python drops what is raised while it clears up weak references: who is not heard asks again."""
    while not file.exists() and not given_up.wait(0.001):
        pass
    while not given_up.is_set():
        os.kill(os.getpid(), signal.SIGINT)
        given_up.wait(0.5)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupted_command_says_how_to_go_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_dir, out = write_run(tmp_path / "run", shots=SHOTS), tmp_path / "volumes"
    common = ["reconstruct", run_dir, "--calibration", write_calibration(tmp_path / "calibration.json")]
    arguments = [*map(str, common), "-o", str(out), "--grid=-1:1,-1:1,-1:1@0.1"]
    given_up = threading.Event()
    thread = threading.Thread(target=interrupt_once_there, args=(out / "shot_00003_a.vtkhdf", given_up))
    thread.start()
    try:
        status = main(arguments)
    finally:
        given_up.set()
        thread.join()
    error = capsys.readouterr().err
    assert status == 1
    assert "go on with --shots " in error
    first = int(error.split("go on with --shots ")[1].split(":")[0])
    assert f"keeps {first} shots of {SHOTS}; go on with --shots {first}:{SHOTS}" in error
    told(capsys, *arguments, "--shots", f"{first}:{SHOTS}")
    assert len(list(out.glob("*.vtkhdf"))) == 2 * SHOTS
