"""Door: what decides who comes in."""

from dataclasses import dataclass, field

from server.web.keys import Keys
from server.web.sessions import Sessions
from server.web.tries import Tries


@dataclass(frozen=True)
class Door:
    """Tokens, browsers that were let in, and who tried in vain."""

    keys: Keys
    sessions: Sessions = field(default_factory=Sessions)
    tries: Tries = field(default_factory=Tries)
