"""Where a server listens: what cannot be is refused before anything is opened, by what the operator has to change."""

import re
import socket
from pathlib import Path

import pytest

from daq.errors import AlreadyHeld
from server.rig.config import ConfigError, ServerConfig
from server.web.port import listening


@pytest.mark.parametrize(
    ("port", "reason"), [(99999, "port 99999: .* 65535"), (-1, "port -1: .* 1"), (9001, "abort_port 9001 .* 0 for any")]
)
def test_a_port_that_cannot_be_is_named(tmp_path: Path, port: int, reason: str) -> None:
    server = ServerConfig(data_dir=tmp_path, abort_port=9001)
    with pytest.raises(ConfigError, match=f"^{reason}"):
        server.moved(None, port)


def test_a_token_is_asked_for_in_words() -> None:
    with pytest.raises(ConfigError, match=r"^host 10\.1\.2\.3 can be reached from the network: set a token$"):
        ServerConfig().moved("10.1.2.3", None)


def test_who_has_a_taken_port_to_change_is_told_what() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        told = f"127.0.0.1, port {port}: cannot listen there (Address already in use): end the server that does, or "
        with pytest.raises(AlreadyHeld, match=f"^{re.escape(told)}choose --port$"), listening("127.0.0.1", port):
            pass
        remedy = "choose another abort_port in the rig file"
        with pytest.raises(AlreadyHeld, match=f"{remedy}$"), listening("127.0.0.1", port, remedy):
            pass
