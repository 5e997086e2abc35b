"""Memory of a server: threads that live for one shot leave none behind."""

import re
import subprocess
import sys

import pytest

PROGRAM = """
import ctypes, threading
from server.web.malloc_arenas import keep_few_arenas
{call}
together = threading.Barrier(12)

def allocate():
    together.wait()
    held = [bytearray(50_000) for _ in range(20)]
    together.wait()

threads = [threading.Thread(target=allocate) for _ in range(12)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
libc = ctypes.CDLL(None)
libc.fdopen.restype = ctypes.c_void_p
libc.malloc_info(0, ctypes.c_void_p(libc.fdopen(1, b"w")))
libc.fflush(None)
"""


def arenas_after(call: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(call=call)], check=True, capture_output=True, text=True, timeout=60
    )
    return len(re.findall("<heap nr", done.stdout))


@pytest.mark.skipif(sys.platform != "linux", reason="arenas are of glibc")
def test_threads_share_two_arenas() -> None:
    assert arenas_after("") > 2
    assert arenas_after("keep_few_arenas()") <= 2
