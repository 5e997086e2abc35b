"""The core's 32-bit arithmetic against the unbounded integers of Python, with numbers that tempt it to overflow."""

import random
import subprocess
from dataclasses import astuple, fields
from pathlib import Path

import pytest

from tests.support.train_oracle import LIMIT, OracleChannel

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "build" / "firmware" / "arithmetic"
CASES = 40_000
TOP = 2**32 - 1
TEMPTING = sorted({0, 1, 3, 4, 2**31, TOP, *LIMIT.values(), LIMIT["MAX_EDGE_NS"] + LIMIT["MAX_WIDTH_NS"]})
FIELDS = len(fields(OracleChannel))
Limits = tuple[int, int, int]


@pytest.fixture(scope="module", autouse=True)
def _built() -> None:
    subprocess.run(
        ["make", "-C", str(ROOT / "firmware"), f"../build/firmware/{PROGRAM.name}"],
        check=True,
        capture_output=True,
        timeout=60,
    )


def tempting(chance: random.Random) -> int:
    return min(max(chance.choice(TEMPTING) + chance.randint(-4, 4), 0), TOP)


def legal(chance: random.Random) -> list[int]:
    """Fields of a channel near or at its limits."""
    a_width_ns, b_width_ns = (chance.choice((200, 1000, 1996, 2000, chance.randint(200, 2000))) for _ in range(2))
    dark_ns = chance.choice((LIMIT["MIN_DARK_NS"], LIMIT["MIN_DARK_NS"] + 8, chance.randint(408, 190_000)))
    a_start_ns = chance.choice((0, 20_000, LIMIT["MAX_EDGE_NS"] - a_width_ns - dark_ns, chance.randint(0, 1 << 24)))
    b_start_ns = a_start_ns + a_width_ns + dark_ns
    camera_ns = chance.choice((0, a_start_ns))
    close_ns = a_start_ns + a_width_ns + chance.choice((0, dark_ns // 2))
    current_ma = chance.choice((0, 400, LIMIT["MAX_LIGHT_MA"], LIMIT["MAX_CURRENT_MA"]))
    last = (0, 0) if chance.random() < 0.1 else (b_start_ns, b_width_ns)
    frames = (close_ns - camera_ns, b_start_ns - camera_ns - chance.choice((0, dark_ns // 4)))
    return [camera_ns, a_start_ns, a_width_ns, *last, current_ma, *frames]


def case(chance: random.Random) -> tuple[OracleChannel, Limits]:
    values = legal(chance)
    for _ in range(chance.choice((0, 0, 1, 2))):
        values[chance.randrange(FIELDS)] = tempting(chance)
    limits = (tempting(chance), chance.choice((0, 1, 2, 199, 200, TOP)), chance.choice((0, 300, 500, TOP)))
    return OracleChannel(*values), limits


def expected(channel: OracleChannel, asked: Limits) -> list[int]:
    if error := channel.error():
        return [error.value]
    actual = channel.quantised()
    error = actual.error()
    said = [error.value if error else 0, *astuple(actual)[:5]]
    if error:
        return said
    absolute = (LIMIT["MAX_CURRENT_MA"], LIMIT["MAX_DUTY_PPM"], LIMIT["MAX_LIGHT_MA"])
    current_ma, duty_ppm, light_ma = (min(limit) for limit in zip(absolute, asked, strict=True))
    within = not actual.current_ma or (actual.current_ma <= current_ma and duty_ppm > 0)
    light_within = not actual.current_ma or (actual.current_ma <= min(current_ma, light_ma) and duty_ppm > 0)
    said += [within, light_within, actual.length_ns]
    return said + ([actual.period_us(duty_ppm) if actual.current_ma else actual.period_us(1)] if within else [])


def test_the_core_reckons_like_unbounded_integers() -> None:
    chance = random.Random(1)
    cases = [case(chance) for _ in range(CASES)]
    lines = "".join(" ".join(str(value) for value in (*astuple(channel), *asked)) + "\n" for channel, asked in cases)
    finished = subprocess.run([PROGRAM], input=lines, capture_output=True, text=True, timeout=60)
    assert finished.returncode == 0, finished.stderr
    said = [[int(word) for word in line.split()] for line in finished.stdout.splitlines()]
    assert len(said) == CASES
    for answer, (channel, asked) in zip(said, cases, strict=True):
        assert answer == expected(channel, asked), (channel, asked)
    outcomes = {answer[0] for answer in said}
    assert outcomes == {0, 13, 14, 15, 16, 17}, "every limit was met"
    assert sum(len(answer) == 10 for answer in said) > CASES // 10, "and many trains were legal to the end"
