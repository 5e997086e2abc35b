"""What the doctor says of a scheduler: nobody there, one that does not know us, and one that answers."""

from pathlib import Path

from server.doctor.checkup import Status
from server.doctor.doctor_scheduler import check_scheduler
from server.rig.processing_config import ProcessingConfig
from tests.support.cluster import cluster, write_certificates
from tests.support.server_process import free_port


def test_the_doctor_finds_a_scheduler_or_says_why_not(tmp_path: Path) -> None:
    alone = check_scheduler(ProcessingConfig(scheduler=f"tcp://127.0.0.1:{free_port()}"))
    assert (alone.name, alone.status) == ("scheduler", Status.FAIL)
    assert "Connection refused" in alone.detail
    assert "start tomoshadow scheduler there" in alone.remedy
    ours, others = (write_certificates(tmp_path / name) for name in ("ours", "others"))
    with cluster(tmp_path / "lab", ours, workers=0) as lab:
        assert check_scheduler(lab.config()).status is Status.OK
        stranger = check_scheduler(lab.config(certificates=others))
    assert stranger.status is Status.FAIL
    assert "certificate verify failed" in stranger.detail
