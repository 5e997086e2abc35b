import socket
from pathlib import Path

from server.rig.config import load_config
from server.rig.rig_lock import hold_rig
from tests.support.fresh_interpreter import modules_after, packages_of

CONFIG = Path(__file__).parents[3] / "configs" / "simulated_small.toml"
HEAVY = {"fastapi", "nicegui", "distributed", "cv2"}


def test_a_server_without_a_port_is_refused_before_anything_heavy_is_loaded() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code = (
            f"from server.cli.main import main\nassert main(['serve', '--config', '{CONFIG}', '--port', '{port}']) == 1"
        )
        assert packages_of(modules_after(code)).isdisjoint(HEAVY)


def test_a_server_of_a_rig_that_is_held_is_refused_before_anything_heavy_is_loaded(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    code = (
        f"import os\nos.chdir('{tmp_path}')\n"
        f"from server.cli.main import main\nassert main(['serve', '--config', '{CONFIG}', '--port', '{port}']) == 1"
    )
    with hold_rig(load_config(CONFIG)):
        assert packages_of(modules_after(code)).isdisjoint(HEAVY)
