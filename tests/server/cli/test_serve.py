import socket
from pathlib import Path

from tests.support.fresh_interpreter import modules_after, packages_of

CONFIG = Path(__file__).parents[3] / "configs" / "simulated_small.toml"


def test_a_server_without_a_port_is_refused_before_anything_heavy_is_loaded() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code = (
            f"from server.cli.main import main\nassert main(['serve', '--config', '{CONFIG}', '--port', '{port}']) == 1"
        )
        assert packages_of(modules_after(code)).isdisjoint({"fastapi", "nicegui", "distributed", "cv2"})
