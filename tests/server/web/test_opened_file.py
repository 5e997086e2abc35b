"""Downloads of what is deleted or replaced meanwhile: all of it, or 404; never a beginning as if it were all."""

import asyncio
from pathlib import Path

import httpx
import pytest
from starlette.types import Receive, Scope, Send

from server.lab.errors import NotFound
from server.web.opened_file import opened_file
from tests.support.serving import Serving, plan_of

CONTENT = bytes(range(256)) * 1000


class Meanwhile:
    """An application during whose answer, right after its head, a file is deleted or replaced."""

    def __init__(self, path: Path, other: bytes | None) -> None:
        self._path, self._other = path, other

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_late(message: dict[str, object]) -> None:
            await send(message)
            if message["type"] == "http.response.start":
                self._path.unlink()
                if self._other is not None:
                    self._path.write_bytes(self._other)

        await opened_file(self._path, "application/x-hdf5", "a.h5")(scope, receive, send_late)  # type: ignore[arg-type]


def asked(path: Path, other: bytes | None = None, **headers: str) -> httpx.Response:
    async def go() -> httpx.Response:
        transport = httpx.ASGITransport(Meanwhile(path, other))
        async with httpx.AsyncClient(transport=transport, base_url="http://here") as client:
            return await client.get("/", headers=headers)

    return asyncio.run(go())


@pytest.mark.parametrize("other", [None, b"short"])
def test_what_is_deleted_or_replaced_while_it_is_sent_comes_whole(tmp_path: Path, other: bytes | None) -> None:
    (path := tmp_path / "a.h5").write_bytes(CONTENT)
    answer = asked(path, other)
    assert (answer.status_code, answer.content) == (200, CONTENT)
    assert int(answer.headers["content-length"]) == len(CONTENT)
    assert answer.headers["content-disposition"] == 'attachment; filename="a.h5"'


def test_a_part_of_it_too(tmp_path: Path) -> None:
    (path := tmp_path / "a.h5").write_bytes(CONTENT)
    answer = asked(path, Range="bytes=1000-1999")
    assert (answer.status_code, answer.content) == (206, CONTENT[1000:2000])


def test_what_is_gone_already_is_not_found(tmp_path: Path) -> None:
    with pytest.raises(NotFound, match=r"a\.h5 is not there any more"):
        opened_file(tmp_path / "a.h5", "application/x-hdf5")


def test_a_picture_under_a_name_that_was_given_again_is_the_new_one(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    for path in (f"/api/runs/{run_id}/thumbnail.jpg", f"/api/runs/{run_id}/shots/0/view1/a.png"):
        first = server.http.get(path)
        assert first.status_code == 200, path
        assert first.headers["cache-control"] == "no-cache"
        known = {"If-None-Match": first.headers["etag"]}
        assert server.http.get(path, headers=known).status_code == 304
