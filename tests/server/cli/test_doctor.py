"""``tomoshadow doctor``: what it tells people."""

import pytest

from server.cli.main import main
from server.doctor.checkup import Checkup, Status


def test_people_get_each_finding_at_once_and_the_count_at_the_end(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [
        Checkup("host", Status.OK, "Debian"),
        Checkup("disk", Status.FAIL, "full", "make room"),
        Checkup("user", Status.OK, "nobody"),
    ]
    monkeypatch.setattr("server.doctor.doctor.examine", lambda _: iter(found))
    assert main(["doctor"]) == 1
    output, progress = capsys.readouterr()
    assert output == "2 ok, 0 warn, 1 fail\n"
    assert progress == "".join(f"{check}\n" for check in found)
