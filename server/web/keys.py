"""Keys: the tokens of a rig file, and what each of them permits."""

import hmac
from dataclasses import dataclass

from server.lab.desk.visitor import Role
from server.rig.config import ServerConfig


@dataclass(frozen=True)
class Keys:
    """Tokens by the role that they give; empty where the loopback interface is protection enough."""

    roles: dict[Role, str]

    @classmethod
    def of(cls, server: ServerConfig) -> "Keys":
        """Those of a rig file."""
        tokens = {Role.OPERATOR: server.token, Role.VIEWER: server.viewer_token}
        return cls({role: token.get_secret_value() for role, token in tokens.items() if token})

    @property
    def are_any(self) -> bool:
        """Whether somebody has to know one."""
        return bool(self.roles)

    def role_of(self, offered: str) -> Role | None:
        """What a token permits; None: nothing. Compares in constant time."""
        fitting = [role for role, token in self.roles.items() if hmac.compare_digest(offered.encode(), token.encode())]
        return fitting[0] if fitting else None
