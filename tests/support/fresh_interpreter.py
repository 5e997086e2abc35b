"""What an interpreter has loaded after some code, in a process of its own."""

import subprocess
import sys


def modules_after(code: str) -> set[str]:
    """Names of all modules that a fresh interpreter holds."""
    told = f"{code}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, timeout=60, check=True)
    return set(done.stdout.splitlines()[-1].split())


def packages_of(modules: set[str]) -> set[str]:
    """The packages that modules belong to."""
    return {module.partition(".")[0] for module in modules}
