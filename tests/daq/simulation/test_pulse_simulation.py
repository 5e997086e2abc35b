"""The simulated pulse generator as a process: what it says of its shots, how it ends, how it is built."""

import gc
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from daq.drivers.serial_pulse_generator import SerialPulseGenerator
from daq.errors import DeviceTimeout, DeviceUnavailable
from daq.run_plan import PulsePair, RunPlan
from daq.shot import FiredTrain
from daq.simulation.pico.firmware_build import build_firmware
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.simulation.pico.piped_process import start_piped
from daq.timing import CameraTiming, plan_shot_timing

CAMERA = CameraTiming(1_000, 20_000, 500, 30_000_000, 1_000_000)
ROOT = Path(__file__).resolve().parents[3]


def test_every_shot_is_told_in_order_and_at_once() -> None:
    channels = {"left": 1, "right": 3}
    pulse = PulsePair(current_a={"left": 20.0, "right": 0.0})
    timing = plan_shot_timing(RunPlan(name="told", shots=20, pulse=pulse), dict.fromkeys(channels, CAMERA))
    told: list[FiredTrain] = []
    delays_s: list[float] = []
    arrived = threading.Semaphore(0)

    def on_fired(train: FiredTrain) -> None:
        told.append(train)
        arrived.release()

    with (
        FirmwareProcess(channels, on_fired) as firmware,
        SerialPulseGenerator("generator", firmware.port, channels) as generator,
    ):
        generator.configure(timing)
        generator.arm(20)
        fired = []
        for _ in range(20):
            start_s = time.monotonic()
            fired.append(generator.fire())
            assert arrived.acquire(timeout=5.0)
            delays_s.append(time.monotonic() - start_s)
            firmware.advance(10)
    assert told == fired
    assert [train.sequence for train in told] == list(range(1, 21))
    assert sorted(delays_s)[10] < 0.02


def test_it_does_not_outlive_a_killed_owner() -> None:
    owner_code = (
        "from daq.simulation.pico.firmware_process import FirmwareProcess\n"
        "import signal\n"
        "with FirmwareProcess({}, lambda train: None) as firmware:\n"
        "    print(firmware.pid, flush=True)\n"
        "    signal.pause()\n"
    )
    owner = subprocess.Popen([sys.executable, "-c", owner_code], stdout=subprocess.PIPE, text=True, cwd=ROOT)
    assert owner.stdout is not None
    pid = int(owner.stdout.readline())
    assert is_alive(pid)
    owner.send_signal(signal.SIGKILL)
    owner.wait(5.0)
    owner.stdout.close()
    deadline_s = time.monotonic() + 5.0
    while is_alive(pid):
        assert time.monotonic() < deadline_s
        time.sleep(0.01)


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_it_ends_with_its_block() -> None:
    with FirmwareProcess({}, lambda _: None) as firmware:
        pid, port = firmware.pid, firmware.port
        assert os.path.exists(port)
    assert not is_alive(pid)


def test_a_killed_generator_takes_no_instructions() -> None:
    with FirmwareProcess({}, lambda _: None) as firmware:
        firmware.kill()
        with pytest.raises(DeviceUnavailable, match="does not run"):
            firmware.set_interlock(False)


def test_many_instructions_at_once_keep_their_answers() -> None:
    with FirmwareProcess({}, lambda _: None) as firmware:
        threads = [threading.Thread(target=firmware.advance, args=(1,)) for _ in range(20)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(5.0)
        assert not any(thread.is_alive() for thread in threads)
        firmware.reset()


def test_without_a_compiler_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(DeviceUnavailable, match=r"firmware_host is missing, and so is make and cc .*\(apt install"):
        build_firmware(tmp_path)


def test_a_build_that_exists_needs_no_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    built = build_firmware()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert build_firmware() == built


def test_the_program_is_built_where_it_is_missing(tmp_path: Path) -> None:
    program = build_firmware(tmp_path / "build")
    finished = subprocess.run([program], input="dance\n", capture_output=True, text=True, timeout=5.0)
    assert finished.returncode == 0
    assert finished.stdout.splitlines()[1:] == ["unknown"]


def test_a_failed_build_shows_the_compiler_s_words(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("CFLAGS", "-include no_such_header.h")
    with pytest.raises(DeviceUnavailable, match=r"no_such_header\.h"):
        build_firmware(tmp_path / "build")


def test_one_that_never_answers_is_ended_and_leaves_nothing_open(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daq.simulation.pico.firmware_process._ANSWER_LIMIT_S", 0.2)
    started = list[subprocess.Popen[str]]()

    def sleep(_: list[str]) -> subprocess.Popen[str]:
        started.append(start_piped(["sleep", "60"]))
        return started[-1]

    monkeypatch.setattr("daq.simulation.pico.firmware_process.start_piped", sleep)
    silent = FirmwareProcess({}, lambda train: None)
    with pytest.raises(DeviceTimeout, match=r"simulated pulse generator: no answer to 'start' within 0\.2 s"), silent:
        pass
    with pytest.raises(ProcessLookupError):
        os.kill(started[0].pid, 0)
    gc.collect()  # an open pipe is an error of the test
