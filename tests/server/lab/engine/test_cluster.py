"""Jobs on other computers: what is killed, started again or cut off loses no job, and no wait is without end."""

import asyncio
import os
import signal
import socket
import ssl
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.lab.engine.cluster_engine import ClusterEngine
from server.lab.engine.in_order import results_in_order
from server.lab.engine.scheduler_link import DEAD_S
from server.lab.engine.task import TaskAborted, TaskError, Unavailable
from server.rig.processing_config import ProcessingConfig
from tests.support.cluster import Cluster, cluster, far_network, write_certificates
from tests.support.cluster_tasks import tell_modules, write_slowly
from tests.support.server_process import LIMIT_S, free_port
from tests.support.soak_cluster import Batch

SHOTS = 8


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_certificates(tmp_path_factory.mktemp("ca") / "lab")


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory, certificates: Path) -> Iterator[Cluster]:
    with cluster(tmp_path_factory.mktemp("lab"), certificates, workers=2) as made:
        yield made


def alone(config: ProcessingConfig, tmp_path: Path) -> None:
    """One job, in an event loop, as the server does it."""

    async def go() -> None:
        async with ClusterEngine(config) as engine:
            await engine.submit(
                "run, shot 7", write_slowly, {"results_dir": str(tmp_path), "shot": 7, "steps": 1}, _ignore
            )

    asyncio.run(asyncio.wait_for(go(), LIMIT_S))


def _ignore(_steps: int) -> None:
    pass


def test_workers_load_neither_server_nor_drivers(lab: Cluster) -> None:
    (told,) = results_in_order(ClusterEngine(lab.config()), tell_modules, {"a": {}})
    loaded = set(told["modules"])
    assert not {"fastapi", "nicegui", "uvicorn", "daq.drivers", "server.web", "server.rig.config"} & loaded
    assert told["threads"] == 1
    assert told["niceness"] == os.nice(0)


def test_a_job_that_is_aborted_ends_and_the_next_of_that_name_does_not(lab: Cluster, tmp_path: Path) -> None:
    job = {"results_dir": str(tmp_path), "shot": 1, "steps": 1000}

    async def go() -> None:
        async with ClusterEngine(lab.config()) as engine:
            going, begun = asyncio.Event(), []

            def on_progress(steps: int) -> None:
                begun.append(steps)
                going.set()

            running = asyncio.ensure_future(engine.submit("a", write_slowly, job, on_progress))
            await asyncio.wait_for(going.wait(), LIMIT_S)
            await engine.abort("a")
            with pytest.raises(TaskAborted):
                await asyncio.wait_for(running, LIMIT_S)
            assert begun[0] == 0
            assert await engine.submit("a", write_slowly, {**job, "steps": 1}, _ignore) == {"shot": 1, "threads": 1}

    asyncio.run(go())


def test_a_worker_that_is_killed_costs_no_shot(lab: Cluster, tmp_path: Path) -> None:
    batch = Batch(lab.config(), tmp_path / "out", SHOTS)
    os.kill(batch.await_begun(3)[-1], signal.SIGKILL)
    assert batch.lost() == 0
    assert len(batch.begun()) > SHOTS, "no job was begun anew: nothing was killed in a job"


def test_a_scheduler_that_is_killed_and_started_again_costs_no_shot(lab: Cluster, tmp_path: Path) -> None:
    batch = Batch(lab.config(), tmp_path / "out", SHOTS)
    batch.await_begun(3)
    lab.kill("scheduler")
    lab.start_scheduler()
    assert batch.lost() == 0


def test_a_scheduler_that_hangs_is_told(lab: Cluster, tmp_path: Path) -> None:
    """It accepts connections, and says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        config = ProcessingConfig(scheduler=f"tcp://127.0.0.1:{deaf.getsockname()[1]}", unreachable_s=1)
        with pytest.raises(Unavailable, match=rf"{config.scheduler} does not answer within 1 s \(unreachable_s\)"):
            alone(config, tmp_path)


def test_nobody_without_certificates_is_heard(lab: Cluster) -> None:
    """What listens beyond the loopback interface wants a certificate of the CA before it says a word."""
    listening = _listening_beyond_loopback()
    assert lab.port in listening
    for port in listening:
        stranger = ssl.create_default_context()
        stranger.check_hostname, stranger.verify_mode = False, ssl.CERT_NONE
        with pytest.raises((ssl.SSLError, ConnectionError)):
            _heard_from(port, stranger)


def _heard_from(port: int, context: ssl.SSLContext) -> bytes:
    with socket.create_connection(("127.0.0.1", port), LIMIT_S) as link, context.wrap_socket(link) as secret:
        if heard := secret.recv(1):
            return heard
    raise ConnectionError


def _listening_beyond_loopback() -> list[int]:
    """TCP ports of this network that are open at more than 127.x and ::1."""
    ports = []
    for table, loopback in (("tcp", "0100007F"), ("tcp6", "00000000000000000000000001000000")):
        for line in Path("/proc/net", table).read_text().splitlines()[1:]:
            _, local, _, state, *_ = line.split()
            host, port = local.split(":")
            if state == "0A" and host != loopback:
                ports.append(int(port, 16))
    return ports


def test_whoever_has_another_ca_is_told_why(lab: Cluster, tmp_path: Path) -> None:
    others = write_certificates(tmp_path / "others")
    config = ProcessingConfig.model_validate({"scheduler": lab.address, "certificates": others, "unreachable_s": 1})
    with pytest.raises(Unavailable, match="certificate verify failed"):
        alone(config, tmp_path)


def test_a_scheduler_that_is_not_there_is_told_and_so_is_one_without_workers(tmp_path: Path) -> None:
    config = ProcessingConfig(scheduler=f"tcp://127.0.0.1:{free_port()}", unreachable_s=1, job_deadline_s=60)
    with pytest.raises(Unavailable, match=rf"{config.scheduler} does not answer within 1 s \(unreachable_s\)"):
        alone(config, tmp_path)
    metadata = tmp_path / "site" / "tomoshadow-9.9.dist-info" / "METADATA"
    metadata.parent.mkdir(parents=True)
    metadata.write_text("Metadata-Version: 2.1\nName: tomoshadow\nVersion: 9.9\n")
    with cluster(tmp_path / "lab", None, workers=0) as bare:
        with pytest.raises(Unavailable, match=r"has had no worker for 1 s \(unreachable_s\).*tomoshadow worker"):
            alone(bare.config(unreachable_s=1), tmp_path)
        bare.start_worker("other", PYTHONPATH=f"{metadata.parents[1]}{os.pathsep}{Path.cwd()}")
        with pytest.raises(TaskError, match=r"worker tcp://\S+ has tomoshadow 9\.9, not 0\.1\.0: install"):
            alone(bare.config(), tmp_path)


def test_a_worker_that_does_not_see_the_files_and_a_job_without_end_are_told(lab: Cluster, tmp_path: Path) -> None:
    config = lab.config(paths={str(tmp_path): "/nowhere"})
    with pytest.raises(TaskError, match=rf"sees no folder /nowhere within 5 s, which is {tmp_path} here: mount it"):
        alone(config, tmp_path)
    with pytest.raises(TaskError, match=r"run, shot 7: no result from the workers .* within 1 s \(job_deadline_s\)"):
        asyncio.run(_endless(lab.config(job_deadline_s=1), tmp_path))


async def _endless(config: ProcessingConfig, tmp_path: Path) -> None:
    job = {"results_dir": str(tmp_path), "shot": 7, "steps": 10_000}
    async with ClusterEngine(config) as engine:
        await engine.submit("run, shot 7", write_slowly, job, _ignore)


def test_a_cable_that_is_out_costs_no_shot_and_who_was_cut_off_comes_back(certificates: Path, tmp_path: Path) -> None:
    """Who asks and a worker are cut off from the scheduler and the other worker, for longer than a connection lives."""
    with (
        far_network() as far,
        cluster(tmp_path / "lab", certificates, workers=0, host=far.far_ip, prefix=far.enter) as lab,
    ):
        for name, prefix, ip in (("far", far.enter, far.far_ip), ("near", (), far.near_ip)):
            lab.start_worker(name, prefix)
            lab.await_word(name, f"as tls://{ip}")
        batch = Batch(lab.config(), tmp_path / "out", 2 * SHOTS)
        batch.await_begun(3)
        far.cut()
        threading.Event().wait(DEAD_S + 3)
        far.mend()
        assert batch.lost() == 0
        assert len(batch.begun()) > 2 * SHOTS, "no shot was begun anew: nothing was cut off"
        lab.await_word("near", "works for", times=2)
