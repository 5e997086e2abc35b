"""Which server a command asks: by its address, or by the rig file it was started with."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tomoshadow.client import RigClient

_EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104  where such a server is reached from here


def add_server(parser: ArgumentParser) -> None:
    """Let a command be told the server. A token never is: the list of processes shows arguments to everybody."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--server", metavar="URL", help="default http://127.0.0.1:8080; its token is taken from TOMOSHADOW_TOKEN"
    )
    where.add_argument("--config", type=Path, metavar="RIG.toml", help="the rig file it was started with, instead")


def client_of(options: Namespace) -> "RigClient":
    """Client of the server that was named."""
    from tomoshadow.client import RigClient

    if options.config is None:
        return RigClient(options.server) if options.server else RigClient()
    from server.rig.config import load_config

    server = load_config(options.config).server
    host = _EVERYWHERE.get(server.host, server.host)
    token = server.token.get_secret_value() if server.token else None
    url = f"http://{f'[{host}]' if ':' in host else host}:{server.port}"
    return RigClient(url, token, server.abort_port or None)


def named(options: Namespace) -> str:
    """The same server, in the words of the next command."""
    if options.config is not None:
        return f" --config {options.config}"
    return f" --server {options.server}" if options.server else ""
