"""ABORT by every way at once: the first door that confirms counts."""

import threading
from queue import Empty, Queue
from time import monotonic
from typing import Any

from tomoshadow.client.connection import Connection
from tomoshadow.client.errors import ClientError
from tomoshadow.client.values import Acquisition, read

LIMIT_S = 1.0
"""Whoever has heard nothing by then goes to the hardware stop."""
_Door = tuple[Connection, str]


def switch_off(doors: list[_Door], limit_s: float = LIMIT_S) -> str:
    """Light off; what was ended, in words.

    Parameters
    ----------
    doors : list
        Connections, each with the path of its ABORT; all are asked at the same time.
    limit_s : float
        What is confirmed later counts all the same, but is not waited for.

    Raises
    ------
    ClientError
        Nobody confirmed that the light is off.
    """
    heard: Queue[str | ClientError] = Queue()
    for door in doors:
        threading.Thread(target=_knock, args=(*door, heard), daemon=True).start()
    end_s, errors = monotonic() + limit_s, list[str]()
    while len(errors) < len(doors):
        try:
            answer = heard.get(timeout=max(0.0, end_s - monotonic()))
        except Empty:
            errors.append(f"no answer within {limit_s:g} s")
            break
        if isinstance(answer, str):
            return answer
        errors.append(answer.text)
    raise ClientError(f"NOT DELIVERED ({'; '.join(errors)})", "not_delivered", "use the hardware stop")


def _knock(connection: Connection, path: str, heard: "Queue[str | ClientError]") -> None:
    try:
        told, _ = connection.ask("POST", path)
        heard.put(read(_ended, told, connection.url))
    except ClientError as error:
        heard.put(error)


def _ended(told: Any) -> str:
    """What either door says when the light is off; others may answer 200 to whatever they are asked."""
    if "light" not in told:
        return Acquisition.of(told).run_id or "whatever was under way"
    if (told["light"], type(told["ended"])) != ("off", str):
        raise ValueError(f"light {told['light']}")
    return str(told["ended"])
