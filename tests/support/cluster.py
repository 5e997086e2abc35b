"""A scheduler and workers in processes of their own, which may be killed; a network of its own that may be cut off."""

import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from server.rig.processing_config import ProcessingConfig
from tests.support.server_process import ENVIRONMENT, LIMIT_S, ROOT, eventually, free_port

PAGE = ROOT / "docs" / "cluster.md"
FAR_S = 3600


def write_certificates(folder: Path) -> Path:
    """Folder of certificates, made as the page says; its path."""
    (block,) = re.findall(r"^```sh\n(.*?openssl.*?)^```", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    folder.mkdir(parents=True)
    subprocess.run(["sh", "-e", "-c", block], cwd=folder, check=True, capture_output=True, timeout=LIMIT_S)
    return folder / "certificates"


@dataclass
class Cluster:
    """Processes of a scheduler and its workers.

    Parameters
    ----------
    work_dir : Path
        What they say goes there.
    certificates : Path | None
        Folder of them.
    host : str
        Of the scheduler, as others see it.
    """

    work_dir: Path
    certificates: Path | None
    host: str = "127.0.0.1"
    port: int = field(default_factory=free_port)
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    @property
    def address(self) -> str:
        return f"{'tls' if self.certificates else 'tcp'}://{self.host}:{self.port}"

    @property
    def options(self) -> list[str]:
        """By which a command finds it."""
        return ["--scheduler", self.address, *self._certified]

    @property
    def _certified(self) -> list[str]:
        return ["--certificates", str(self.certificates)] if self.certificates else []

    def config(self, **changes: object) -> ProcessingConfig:
        """The same, of a rig file."""
        return ProcessingConfig.model_validate(
            {"scheduler": self.address, "certificates": self.certificates, **changes}
        )

    def start_scheduler(self, prefix: Sequence[str] = ()) -> None:
        self._start("scheduler", [*prefix], "scheduler", "--port", str(self.port), *self._certified)
        self.await_word("scheduler", "listens at")

    def start_worker(self, name: str, prefix: Sequence[str] = (), **environment: str) -> None:
        self._start(name, [*prefix], "worker", *self.options, "--threads", "1", "--memory", "4GiB", **environment)

    def await_word(self, name: str, word: str, times: int = 1) -> None:
        """Wait until a process has said something so many times."""

        def said() -> bool:
            assert self.processes[name].poll() is None, self.log(name)
            return self.log(name).count(word) >= times

        eventually(said, f"{name} says {word}", lambda: self.log(name))

    def log(self, name: str) -> str:
        return (self.work_dir / f"{name}.log").read_text()

    def kill(self, name: str) -> None:
        """End a process without a warning."""
        process = self.processes.pop(name)
        process.kill()
        process.wait(LIMIT_S)

    def _start(self, name: str, prefix: list[str], *arguments: str, **environment: str) -> None:
        command = [*prefix, str(Path(sys.executable).with_name("tomoshadow")), *arguments]
        with (self.work_dir / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                command, cwd=self.work_dir, env={**ENVIRONMENT, **environment}, stdout=log, stderr=log
            )

    def end(self) -> None:
        """End all that is left; those who work come first, so that they need not look for a scheduler."""
        for name in sorted(self.processes, key=lambda name: name == "scheduler"):
            self.processes[name].send_signal(signal.SIGTERM)
            self.processes[name].wait(LIMIT_S)


@contextmanager
def cluster(
    work_dir: Path, certificates: Path | None, workers: int, host: str = "127.0.0.1", prefix: Sequence[str] = ()
) -> Iterator[Cluster]:
    """A scheduler with so many workers, until the block ends; the prefix takes the scheduler elsewhere."""
    work_dir.mkdir(exist_ok=True)
    with ExitStack() as stack:
        made = Cluster(work_dir, certificates, host)
        stack.callback(made.end)
        made.start_scheduler(prefix)
        for number in range(workers):
            made.start_worker(f"worker{number}")
        for number in range(workers):
            made.await_word(f"worker{number}", "works for")
        yield made


@dataclass(frozen=True)
class FarNetwork:
    """A network of its own, at the other end of one cable."""

    near_link: str
    near_ip: str
    far_ip: str
    enter: tuple[str, ...]

    def cut(self) -> None:
        _ip("link", "set", self.near_link, "down")

    def mend(self) -> None:
        _ip("link", "set", self.near_link, "up")


@contextmanager
def far_network(number: int = 1) -> Iterator[FarNetwork]:
    """A cable to another network, until the block ends; the test itself must be in a private network."""
    near, far, net = f"near{number}", f"far{number}", f"10.77.{number}"
    with subprocess.Popen(["unshare", "-n", "sleep", str(FAR_S)]) as keeper:
        try:
            eventually(lambda: _namespace(keeper.pid) != _namespace("self"), "there is another network")
            _ip("link", "add", near, "type", "veth", "peer", "name", far, "netns", str(keeper.pid))
            _ip("addr", "add", f"{net}.1/24", "dev", near)
            _ip("link", "set", near, "up")
            enter = ("nsenter", "-t", str(keeper.pid), "-n")
            for told in (f"addr add {net}.2/24 dev {far}", f"link set {far} up", "link set lo up"):
                subprocess.run([*enter, "ip", *told.split()], check=True, timeout=LIMIT_S)
            yield FarNetwork(near, f"{net}.1", f"{net}.2", enter)
        finally:
            keeper.kill()


def _namespace(process: int | str) -> str:
    return str(Path(f"/proc/{process}/ns/net").readlink())


def _ip(*told: str) -> None:
    subprocess.run(["ip", *told], check=True, timeout=LIMIT_S)
