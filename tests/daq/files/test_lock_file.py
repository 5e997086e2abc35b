import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from daq.errors import AlreadyHeld
from daq.files.lock_file import hold

HOLDER = """
import sys, time
from pathlib import Path
from daq.files.lock_file import hold
with hold(Path(sys.argv[1]), "the rig"):
    print("held", flush=True)
    time.sleep(600)
"""


def test_one_holds_at_a_time_and_the_other_is_told_who_and_since_when(tmp_path: Path) -> None:
    lock = tmp_path / "lock"
    with hold(lock, "the rig"):
        held = rf"^the rig is held by process {os.getpid()}, since 20[-0-9: ]+ UTC: end that first"
        with pytest.raises(AlreadyHeld, match=held), hold(lock, "the rig"):
            pass
        assert lock.stat().st_mode & 0o777 == 0o666, "another user may hold it next"
    with hold(lock, "the rig"):
        pass


def test_the_kernel_lets_go_for_a_process_that_is_killed(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLDER, str(tmp_path / "lock")]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(AlreadyHeld, match=f"process {holder.pid}, since"), hold(tmp_path / "lock", "the rig"):
            pass
        holder.send_signal(signal.SIGKILL)
        holder.wait(20)
    with hold(tmp_path / "lock", "the rig"):
        pass
