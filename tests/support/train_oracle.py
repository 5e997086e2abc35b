"""What a channel may be and what becomes of it, once more after firmware/README.md, in unbounded integers."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

from daq.drivers.pulse_protocol import ErrorNumber

TICK_NS = 8
CURRENT_STEP_MA = 10
HEADER = (Path(__file__).resolve().parents[2] / "firmware" / "core" / "limits.h").read_text()
LIMIT = {name: int(value) for name, value in re.findall(r"(\w+) = (\d+)", HEADER)}
START_US = 10
"""The firmware's allowance for starting a shot."""


@dataclass(frozen=True)
class OracleChannel:
    """Fields of the command CHANNEL, after the number."""

    camera_ns: int
    a_start_ns: int
    a_width_ns: int
    b_start_ns: int
    b_width_ns: int
    current_ma: int
    frame_a_close_ns: int
    frame_b_open_ns: int

    def quantised(self) -> "OracleChannel":
        def nearest(time_ns: int) -> int:
            return (time_ns + TICK_NS // 2) // TICK_NS * TICK_NS

        names = ("camera_ns", "a_start_ns", "a_width_ns", "b_start_ns", "b_width_ns")
        actual = {name: nearest(getattr(self, name)) for name in names}
        return replace(self, **actual, current_ma=self.current_ma // CURRENT_STEP_MA * CURRENT_STEP_MA)

    @property
    def single(self) -> bool:
        return self.b_start_ns == self.b_width_ns == 0

    def error(self) -> ErrorNumber | None:
        """The first limit that it breaks."""
        a_end_ns = self.a_start_ns + self.a_width_ns
        widths_ns = (self.a_width_ns,) if self.single else (self.a_width_ns, self.b_width_ns)
        dark_ns, separation_ns = self.b_start_ns - a_end_ns, self.b_start_ns - self.a_start_ns
        if max(self.camera_ns, self.a_start_ns, self.b_start_ns) > LIMIT["MAX_EDGE_NS"]:
            return ErrorNumber.EDGE
        if any(not LIMIT["MIN_WIDTH_NS"] <= width_ns <= LIMIT["MAX_WIDTH_NS"] for width_ns in widths_ns):
            return ErrorNumber.WIDTH
        if not self.single and (dark_ns < LIMIT["MIN_DARK_NS"] or separation_ns > LIMIT["MAX_SEPARATION_NS"]):
            return ErrorNumber.SEPARATION
        if self.current_ma > LIMIT["MAX_CURRENT_MA"]:
            return ErrorNumber.CURRENT
        return None if self._straddles(a_end_ns) else ErrorNumber.STRADDLE

    def _straddles(self, a_end_ns: int) -> bool:
        a_close_ns = self.camera_ns + self.frame_a_close_ns
        b_open_ns = self.camera_ns + self.frame_b_open_ns
        return a_end_ns <= a_close_ns and (self.single or a_close_ns <= b_open_ns <= self.b_start_ns)

    @property
    def length_ns(self) -> int:
        """Until the last of its outputs has fallen."""
        ends_ns = (self.a_start_ns + self.a_width_ns, self.b_start_ns + self.b_width_ns)
        return max(self.camera_ns + LIMIT["CAMERA_PULSE_NS"], *ends_ns)

    def period_us(self, max_duty_ppm: int) -> int:
        """Shortest time from shot to shot, of this channel alone."""
        lit_ns = self.a_width_ns + self.b_width_ns if self.current_ma else 0
        resting_us = -(-lit_ns * 1000 // max_duty_ppm)
        return max(LIMIT["MIN_PERIOD_US"], self.length_ns // 1000 + START_US, resting_us)
