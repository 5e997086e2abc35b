"""``tomoshadow scheduler``: where it listens is where it was told to."""

import pytest

from server.cli.main import _parser


@pytest.mark.parametrize("port", ["65536", "99999", "0", "x"])
def test_a_port_that_there_is_not_is_refused_and_no_other_one_taken(
    capsys: pytest.CaptureFixture[str], port: str
) -> None:
    with pytest.raises(SystemExit) as refused:
        _parser().parse_args(["scheduler", "--port", port])
    assert refused.value.code == 2
    assert port in capsys.readouterr().err
