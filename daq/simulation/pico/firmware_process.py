"""The simulated pulse generator: the firmware's own core as a process behind a pseudo-terminal.

The real driver opens ``FirmwareProcess.port``; what the core fires arrives as a ``FiredTrain``, for the trigger line
and the light of the simulated cameras.
"""

import importlib.util
import os
import queue
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from daq.errors import DeviceTimeout, DeviceUnavailable
from daq.shot import FiredTrain, LightPulse
from daq.simulation.pico.firmware_build import build_firmware, build_image
from daq.simulation.pico.piped_process import lines_of, start_piped
from daq.simulation.port_link import PortLink

_DEVICE = "simulated pulse generator"
_ANSWER_LIMIT_S = 20.0
"""Three seconds of an emulated board that is armed take two of a processor, which others use too."""
STANDSTILL_S = _ANSWER_LIMIT_S
_FIELDS_PER_CHANNEL = 7


class FirmwareProcess:
    """A pulse generator that runs on this computer: in real time, but for an emulated one where that is too slow.

    Parameters
    ----------
    channels : Mapping[str, int]
        Channel of each view, as the driver has it.
    on_fired : Callable[[FiredTrain], None]
        Called from the reading thread for every shot. If it raises, the generator dies with it.
    emulated : bool
        Run the image of the Raspberry Pi Pico in an emulator, instead of the core built for this computer.
    port : Path | None
        Where its serial port shall be; else in a folder of its own.
    """

    def __init__(
        self,
        channels: Mapping[str, int],
        on_fired: Callable[[FiredTrain], None],
        *,
        emulated: bool = False,
        port: Path | None = None,
    ) -> None:
        self._emulated = emulated
        self._clock: IO[bytes] | None = None
        self._views = {number: view for view, number in channels.items()}
        self._on_fired = on_fired
        self._process: subprocess.Popen[str] | None = None
        self._answers: queue.Queue[str] = queue.Queue()
        self._instructing = threading.Lock()
        self._reader: threading.Thread | None = None
        self._link = PortLink("pulse_generator", port)
        self._plugging = threading.RLock()
        self._hangs = False
        self._inputs: dict[str, bool] = {}
        self._light_a: Mapping[str, float] = {}

    @property
    def port(self) -> str:
        """Path of the serial port; the same whenever the generator is plugged in."""
        return self._link.path

    @property
    def pid(self) -> int:
        """Process id, for tests that stop it."""
        return self._running().pid

    @property
    def has_died(self) -> bool:
        """It is plugged in, and has ended all the same."""
        return self._process is not None and self._process.poll() is not None

    def __enter__(self) -> Self:
        self.plug_in()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.unplug()
        self._link.remove()
        if self._clock is not None:
            self._clock.close()

    def plug_in(self) -> None:
        """Give it cable and power: it boots, and its inputs are as the laboratory has left them."""
        with self._plugging:
            if self._process is not None:
                return
            self._answers = queue.Queue()
            self._process = process = self._start_emulator() if self._emulated else start_piped([str(build_firmware())])
            self._reader = threading.Thread(target=self._read_events, args=(process,), name=_DEVICE, daemon=True)
            self._reader.start()
            try:
                self._link.lead_to(self._answer("start").removeprefix("port "))
            except DeviceTimeout:
                self._end(process)
                raise
            self._apply_inputs()

    def unplug(self) -> None:
        """Pull the cable, and with it the power."""
        with self._plugging:
            if self._process is not None:
                self._link.lead_nowhere()
                self._end(self._process)

    def hang(self) -> None:
        """Let the microcontroller stand still."""
        with self._plugging:
            if self._process is not None:
                self._process.send_signal(signal.SIGSTOP)
                self._hangs = True

    def go_on(self) -> None:
        """Let it go on."""
        with self._plugging:
            if self._process is not None and self._hangs:
                self._process.send_signal(signal.SIGCONT)
                self._hangs = False
                self._apply_inputs()

    def _start_emulator(self) -> subprocess.Popen[str]:
        if importlib.util.find_spec("rp2040py") is None:
            missing = "rp2040py, which emulates the Pico, is missing (pip install rp2040py==0.3.6)"
            raise DeviceUnavailable(_DEVICE, missing)
        if self._clock is not None:
            self._clock.close()
        self._clock = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the process
        clock = self._clock.fileno()
        program = [sys.executable, "-m", "daq.simulation.pico.emulated_firmware", str(build_image()), str(clock)]
        return start_piped(program, clock)

    def clock_s(self) -> float:
        """The generator's own time, which does not go on while an emulated one is not given a processor.

        Raises
        ------
        DeviceUnavailable
            It stands still.
        """
        if self._clock is None:
            return time.monotonic()
        if time.time() - os.fstat(self._clock.fileno()).st_mtime > STANDSTILL_S:
            raise DeviceUnavailable(_DEVICE, f"has stood still for {STANDSTILL_S:g} s")
        (now_s,) = struct.unpack("d", os.pread(self._clock.fileno(), 8, 0))
        return float(now_s)

    def _end(self, process: subprocess.Popen[str]) -> None:
        process.kill()
        process.wait(_ANSWER_LIMIT_S)
        if self._reader is not None:
            self._reader.join(_ANSWER_LIMIT_S)
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(BrokenPipeError):  # an instruction to a generator that had died before
                    pipe.close()
        self._process, self._hangs, self._light_a = None, False, {}

    def set_interlock(self, closed: bool) -> None:
        """Open or close the generator's interlock input."""
        self._set_input("interlock", closed)

    def set_estop(self, closed: bool) -> None:
        """Open or close the input of the generator's emergency stop."""
        self._set_input("estop", closed)

    def _set_input(self, name: str, closed: bool) -> None:
        """What is wired to an input has its state whether or not somebody looks at it."""
        with self._plugging:
            self._inputs[name] = closed
            if self._process is not None and not self._hangs:
                self._instruct(f"{name} {int(closed)}")

    def _apply_inputs(self) -> None:
        for name, closed in self._inputs.items():
            self._instruct(f"{name} {int(closed)}")

    def set_converter(self, working: bool) -> None:
        """Let the set-points of the currents be confirmed as zero, or not."""
        self._instruct(f"converter {int(working)}")

    def trigger(self) -> None:
        """Give a rising edge to the generator's trigger input."""
        self._instruct("trigger")

    @property
    def light_a(self) -> Mapping[str, float]:
        """Current of the continuous light of each view; empty while there is none."""
        return self._light_a

    def reset(self, *, by_watchdog: bool = False) -> None:
        """Restart the microcontroller."""
        self._instruct("reset watchdog" if by_watchdog else "reset")

    def advance(self, time_ms: int) -> None:
        """Let time pass for the generator alone."""
        self._instruct(f"advance {time_ms}")

    def garbage(self, data: bytes) -> None:
        """Put bytes on the line that the driver receives."""
        self._instruct(f"garbage {data.hex()}")

    def noise(self, data: bytes) -> None:
        """Put bytes on the line that the generator receives."""
        self._instruct(f"noise {data.hex()}")

    def lose_replies(self, count: int) -> None:
        """Let the next replies vanish."""
        self._instruct(f"lose {count}")

    def damage_replies(self, count: int) -> None:
        """Flip a bit in each of the next replies."""
        self._instruct(f"damage {count}")

    def kill(self) -> None:
        """End the generator without warning, as a pulled plug does."""
        process = self._running()
        process.send_signal(signal.SIGKILL)
        process.wait(_ANSWER_LIMIT_S)

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None:
            raise DeviceUnavailable(_DEVICE, "is not plugged in")
        return self._process

    def _instruct(self, line: str) -> None:
        process = self._running()
        if process.stdin is None:
            raise DeviceUnavailable(_DEVICE, "has no control channel")
        with self._instructing:
            try:
                process.stdin.write(f"{line}\n")
                process.stdin.flush()
            except OSError as error:
                raise DeviceUnavailable(_DEVICE, f"does not run any more: {error}") from error
            if self._answer(line) != "done":
                raise DeviceUnavailable(_DEVICE, f"does not know {line!r}")

    def _answer(self, line: str) -> str:
        try:
            return self._answers.get(timeout=_ANSWER_LIMIT_S)
        except queue.Empty:
            raise DeviceTimeout(_DEVICE, line, _ANSWER_LIMIT_S) from None

    def _read_events(self, process: subprocess.Popen[str]) -> None:
        try:
            for line in lines_of(process):
                if line.startswith("fired "):
                    self._on_fired(self._fired_train(line))
                elif line == "dark" or line.startswith("lit "):
                    self._light_a = self._continuous_light(line)
                else:
                    self._answers.put(line)
        finally:
            process.kill()

    def _continuous_light(self, line: str) -> Mapping[str, float]:
        numbers = iter(map(int, line.split()[1:]))
        currents_ma = dict(zip(numbers, numbers, strict=True))
        return {view: currents_ma[channel] / 1000 for channel, view in self._views.items() if currents_ma.get(channel)}

    def _fired_train(self, line: str) -> FiredTrain:
        sequence, *numbers = map(int, line.split()[1:])
        channels = [
            numbers[start : start + _FIELDS_PER_CHANNEL] for start in range(0, len(numbers), _FIELDS_PER_CHANNEL)
        ]
        wired = {self._views[channel]: edges for channel, *edges in channels if channel in self._views}
        return FiredTrain(
            sequence,
            camera_trigger_ns={view: edges[0] for view, edges in wired.items()},
            pulses={view: _light(edges[1:]) for view, edges in wired.items()},
        )


def _light(edges: list[int]) -> tuple[LightPulse, ...]:
    a_start_ns, a_width_ns, b_start_ns, b_width_ns, current_ma = edges
    if not current_ma:
        return ()
    pulses = ((a_start_ns, a_width_ns), (b_start_ns, b_width_ns))
    return tuple(LightPulse(start_ns, width_ns, current_ma / 1000) for start_ns, width_ns in pulses if width_ns)
