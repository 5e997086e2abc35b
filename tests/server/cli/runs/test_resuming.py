"""An interrupted command says what it leaves and how to go on, and it can be done; no interruption is missed."""

import io
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest

from server.cli.main import main
from tests.support.command_line import told
from tests.support.droplet_run import DROPLETS_A_MM, cameras, shadowgraph, write_calibration, write_run

SHOTS = 12


@pytest.fixture(autouse=True)
def heard() -> Iterator[None]:
    """SIGTERM would end the tests."""
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    yield
    signal.signal(signal.SIGTERM, before)


class Interrupting(io.StringIO):
    """A stream on which the process is interrupted, once, when a text is written."""

    def __init__(self, text: str, number: int, *, dropped: bool) -> None:
        super().__init__()
        self._text, self._number, self._dropped = text, number, dropped

    def write(self, text: str) -> int:
        if self._text and self._text in text:
            self._text = ""
            if self._dropped:
                _Interrupted(self._number)
            else:
                signal.raise_signal(self._number)
        return super().write(text)


class _Interrupted:
    """Is interrupted while it is cleared up, at once: Python drops what is raised there."""

    def __init__(self, number: int) -> None:
        self._number = number

    def __del__(self) -> None:
        signal.raise_signal(self._number)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(("number", "dropped"), [(signal.SIGINT, False), (signal.SIGINT, True), (signal.SIGTERM, True)])
def test_an_interrupted_command_says_how_to_go_on(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    number: int,
    dropped: bool,
) -> None:
    run_dir, out = write_run(tmp_path / "run", shots=SHOTS), tmp_path / "volumes"
    common = ["reconstruct", run_dir, "--calibration", write_calibration(tmp_path / "calibration.json")]
    arguments = [*map(str, common), "-o", str(out), "--grid=-1:1,-1:1,-1:1@0.1"]
    with monkeypatch.context() as stream:
        stream.setattr("sys.stderr", error := Interrupting("shot 2 by", number, dropped=dropped))
        status = main(arguments)
    assert status == 1
    said = re.search(rf"keeps (\d+) shots of {SHOTS}; go on with --shots (\d+):{SHOTS}", error.getvalue())
    assert said, error.getvalue()
    first = int(said[1])
    assert int(said[2]) == first
    assert 2 <= first < SHOTS
    assert len(list(out.glob("*.vtkhdf"))) == 2 * first
    told(capsys, *arguments, "--shots", f"{first}:{SHOTS}")
    assert len(list(out.glob("*.vtkhdf"))) == 2 * SHOTS


def test_a_second_signal_ends_a_command_at_once() -> None:
    code = """
import signal
from server.cli.output import endable
with endable():
    try:
        signal.raise_signal(signal.SIGINT)
    finally:
        signal.raise_signal(signal.SIGINT)
        print("too late")
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (-signal.SIGINT, "")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_import_leaves_nothing_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    lines = ['[run]\npolarity = "shadow"\n']
    for shot in range(3):
        for name, camera in cameras().items():
            cv2.imwrite(str(tmp_path / f"{name}_{shot}.png"), shadowgraph(camera, DROPLETS_A_MM))
        images = ", ".join(f"{name} = '{name}_{shot}.png'" for name in cameras())
        lines.append(f"[[run.shot]]\nframe_a = {{ {images} }}\n")
    (tmp_path / "manifest.toml").write_text("\n".join(lines))
    before = sorted(tmp_path.iterdir())
    terminal = Interrupting("1/3", number, dropped=True)
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    with monkeypatch.context() as stream:
        stream.setattr("sys.stderr", terminal)
        status = main(["import", str(tmp_path / "manifest.toml"), "-o", str(tmp_path / "out")])
    assert status == 1
    assert "out: all or nothing, so nothing was written; to go on, import again" in terminal.getvalue()
    assert sorted(tmp_path.iterdir()) == before
