"""The command line itself: usage, help, exit status, and readers that have seen enough."""

import io
import os
import re
import subprocess
import sys
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path

import pytest

from processing.errors import BadInput
from server.cli.main import BLAS_THREADS, COMMANDS, main
from tests.support.command_line import refused
from tests.support.fresh_interpreter import modules_after, packages_of

ROOT = Path(__file__).parents[3]
HEAVY = {
    *("numpy", "cv2", "h5py", "scipy", "skimage", "matplotlib", "pydantic"),
    *("fastapi", "starlette", "nicegui", "uvicorn", "dask", "distributed", "gi", "serial", "gpiod"),
}


@cache
def help_of(*words: str) -> str:
    told = io.StringIO()
    with redirect_stdout(told), pytest.raises(SystemExit) as ended:
        main([*words, "--help"])
    assert ended.value.code == 0
    return told.getvalue()


def all_words(*before: str) -> list[list[str]]:
    """Words of a command and of all that its help names."""
    verbs = re.findall(r"^ {4}([a-z][a-z-]*)(?: |$)", help_of(*before), re.MULTILINE)
    return [[*before], *(words for verb in verbs for words in all_words(*before, verb))]


def test_unknown_usage_exits_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["reconstruct", "--method", "magic"])
    assert stopped.value.code == 2
    assert "usage" in capsys.readouterr().err


def test_help_loads_nothing_that_is_heavy() -> None:
    """Measured by what is imported: time says little on a busy machine."""
    code = f"""
from contextlib import suppress
from server.cli.main import main
for words in {all_words()}:
    with suppress(SystemExit):
        main([*words, "--help"])
"""
    modules = modules_after(code)
    assert {command.__name__ for command in COMMANDS} <= modules
    assert not packages_of(modules) & HEAVY


@pytest.mark.parametrize(("chosen", "threads"), [(None, "1"), ("3", "3")])
def test_a_program_multiplies_matrices_by_one_thread_unless_somebody_chose_otherwise(
    chosen: str | None, threads: str
) -> None:
    code = f"""
import os, sys
from contextlib import suppress
from server.cli.main import program
sys.argv = ["tomoshadow", "--help"]
with suppress(SystemExit):
    program()
assert "numpy" not in sys.modules
print(os.environ["{BLAS_THREADS}"])
"""
    others = {name: value for name, value in os.environ.items() if name != BLAS_THREADS}
    environment = others | ({BLAS_THREADS: chosen} if chosen else {})
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines()[-1:] == [threads], done.stderr


def test_a_command_leaves_the_environment_of_its_caller_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(BLAS_THREADS, raising=False)
    before = dict(os.environ)
    refused(capsys, "average", tmp_path, "-o", tmp_path / "mean.h5")
    assert dict(os.environ) == before


def test_every_command_has_help() -> None:
    found = all_words()
    assert len([words for words in found if len(words) == 1]) == len(COMMANDS)
    assert {"study", "firmware"} == {words[0] for words in found if len(words) == 2}
    for words in found:
        assert help_of(*words).startswith(" ".join(["usage: tomoshadow", *words]))


def test_bad_input_is_told_apart_from_failure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(error: Exception) -> None:
        raise error

    arguments = ["optics", "--config", tmp_path / "rig.toml"]
    monkeypatch.setattr("server.rig.config.load_config", lambda _: fail(BadInput("rig.toml, line 3: wrong")))
    assert refused(capsys, *arguments) == "rig.toml, line 3: wrong"
    monkeypatch.setattr("server.rig.config.load_config", lambda _: fail(OSError("disk full")))
    assert main([*map(str, arguments)]) == 1
    assert capsys.readouterr().err == "tomoshadow: disk full\n"


@pytest.mark.parametrize("words", [["--help"], ["optics", "--config", "configs/spray4view.toml"]])
def test_a_reader_who_has_seen_enough_ends_it_quietly(words: list[str]) -> None:
    """As ``| head`` does: what a pipe is written to that nobody reads any more."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "server.cli", *words]
    try:
        done = subprocess.run(command, cwd=ROOT, stdout=writing, stderr=subprocess.PIPE, timeout=60, check=False)
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")
