"""What ``tomoshadow doctor`` asks of a scheduler: does it answer, and does it know our certificates."""

import contextlib
import socket
from urllib.parse import urlsplit

from server.doctor.checkup import Checkup, Status
from server.rig.certificates import mutual_context
from server.rig.processing_config import ProcessingConfig

_DEADLINE_S = 5.0
_REMEDY = (
    "start tomoshadow scheduler there; are both certificates of the same CA and not out of date, does a firewall let "
    "its port pass (processing.scheduler and processing.certificates in the rig file, docs/cluster.md)"
)


def check_scheduler(processing: ProcessingConfig) -> Checkup:
    """Connect to the scheduler of a rig file, as its server will."""
    address = urlsplit(processing.scheduler or "")
    try:
        with contextlib.ExitStack() as stack:
            link = stack.enter_context(socket.create_connection((address.hostname, address.port), _DEADLINE_S))
            if processing.certificates:
                link = stack.enter_context(mutual_context(processing.certificates).wrap_socket(link))
            link.settimeout(_DEADLINE_S)
            if not link.recv(1):  # a scheduler that does not know us says nothing
                raise ConnectionError("it ends the connection")
    except OSError as error:
        return Checkup("scheduler", Status.FAIL, f"{processing.scheduler} within {_DEADLINE_S:g} s: {error}", _REMEDY)
    return Checkup("scheduler", Status.OK, f"{processing.scheduler} answers")
