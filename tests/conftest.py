"""What all tests share: property tests try the same examples in every run, and however slow the machine is.

``TEST_OPTIONS=--hypothesis-profile=others`` tries others. Ctrl-C is heard even where a shell runs the tests in its
background, which has them, and so the programs that they start, ignore it.

Of 8,000 tests and 2,500 modules nothing is garbage: the collector looks for none until all are there, nor among them.
"""

import gc
import signal

from hypothesis import settings

gc.disable()
signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("others", deadline=None)
settings.load_profile("repeatable")


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()
