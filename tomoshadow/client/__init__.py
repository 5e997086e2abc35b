"""Client of a tomoshadow server: ask, start, follow, stop and abort runs from a script.

Scripts and ``server.cli.clients`` import it. It needs nothing but Python: neither server
nor processing.
"""

from tomoshadow.client.errors import ClientError
from tomoshadow.client.rig_client import RigClient
from tomoshadow.client.values import Acquisition, Alarm, Event, Readiness, Reason, Rig, Run

__all__ = ["Acquisition", "Alarm", "ClientError", "Event", "Readiness", "Reason", "Rig", "RigClient", "Run"]
