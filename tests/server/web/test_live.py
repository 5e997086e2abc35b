from typing import Any

import cv2
import numpy as np
from websockets.sync.client import connect

from tests.support.serving import DEADLINE_S, Serving, plan_of


def test_every_reader_gets_the_newest_picture_of_every_view(server: Serving) -> None:
    address = f"ws://127.0.0.1:{server.port}/api/live"
    with connect(address) as first, connect(address) as second:
        server.run_to_its_end(plan_of(shots=2))
        for reader in (first, second):
            pictures: dict[int, Any] = {}
            while len(pictures) < 2:
                message = reader.recv(DEADLINE_S)
                assert isinstance(message, bytes)
                pictures[message[0]] = cv2.imdecode(np.frombuffer(message[1:], np.uint8), cv2.IMREAD_UNCHANGED)
            for picture in pictures.values():
                assert picture is not None
                assert picture.shape == (96, 128)
                assert picture.std() > 20


def test_a_reader_that_leaves_disturbs_nobody(server: Serving) -> None:
    address = f"ws://127.0.0.1:{server.port}/api/live"
    with connect(address) as staying:
        for _ in range(5):
            with connect(address):
                pass
        server.run_to_its_end(plan_of(shots=1))
        assert staying.recv(DEADLINE_S)
    assert server.http.get("/api/rig").status_code == 200
