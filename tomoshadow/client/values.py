"""What a server says of rig, runs, alarms and events, as frozen values. What a newer server adds is left out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from types import UnionType
from typing import Any, Self, TypeVar, get_origin

from tomoshadow.client.errors import ClientError

Value = TypeVar("Value")


def read(value_of: Callable[[Any], Value], told: Any, url: str) -> Value:
    """A value of what the server at ``url`` says; ClientError if it says something else."""
    try:
        return value_of(told)
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        text = f"{url} says something else than this client expects ({error})"
        raise ClientError(text, "senseless", "use the client of the same version") from error


def of_kind(name: str, value: Any, kind: Any) -> Any:
    """The value, or TypeError if it is not of this kind."""
    if not isinstance(value, kind if isinstance(kind, UnionType) else get_origin(kind) or kind):
        raise TypeError(f"{name} is {str(value)[:40]!r}")
    return value


@dataclass(frozen=True)
class _Told:
    """A value of the fields that it knows of a JSON object."""

    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Self:
        """Take what has a place here; TypeError where it is of another kind."""
        known = {field.name: field.type for field in fields(cls) if field.name in told}
        return cls(**{name: of_kind(name, told[name], kind) for name, kind in known.items()})


@dataclass(frozen=True)
class Reason(_Told):
    """One thing that speaks against a start: code for programs, text, and what to do."""

    code: str
    text: str
    remedy: str


@dataclass(frozen=True)
class Readiness:
    """Whether a start would be refused.

    Parameters
    ----------
    ready : bool
        It would not.
    state : str
        ``ready``, ``not ready``, ``live``, ``arming``, ``acquiring``, ``disarming`` or ``fault``; empty for a
        plan.
    text : str
        The same for people.
    reasons : tuple[Reason, ...]
        Everything against it; a refused start names the first one.
    """

    ready: bool
    state: str
    text: str
    reasons: tuple[Reason, ...]

    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Self:
        """Readiness of a rig, or of a plan on it."""
        reasons = tuple(map(Reason.of, told["reasons"]))
        state = told.get("state", "")
        return cls(told.get("ready", state == "ready"), of_kind("state", state, str), told.get("text", ""), reasons)


@dataclass(frozen=True)
class Acquisition(_Told):
    """What acquisition does: ``outcome`` is None while the run is active; ``message`` says what happened last."""

    state: str
    outcome: str | None
    run_id: str | None
    shots_planned: int
    shots_recorded: int
    shots_valid: int
    message: str

    @property
    def active_run(self) -> str | None:
        """The run under way."""
        return self.run_id if self.state in ("arming", "acquiring", "disarming") and not self.outcome else None


@dataclass(frozen=True)
class Rig:
    """The rig at a glance; ``beat`` is the pulse of its server now, ``abort_port`` the port of ABORT alone."""

    name: str
    simulated: bool
    views: tuple[str, ...]
    acquisition: Acquisition
    beat: int
    abort_port: int

    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Self:
        """What ``GET /api/rig`` says, without the lamps."""
        acquisition = Acquisition.of(told["acquisition"])
        views = tuple(told["views"])
        beat, port = (of_kind(name, told[name], int) for name in ("beat", "abort_port"))
        return cls(told["name"], told["simulated"], views, acquisition, beat, port)


@dataclass(frozen=True)
class Run(_Told):
    """One run; ``outcome`` is ``active`` while it is recorded, ``shots_valid`` None before its end."""

    run_id: str
    name: str
    kind: str | None
    created_utc: str
    outcome: str
    cause: str
    shots_planned: int | None
    shots_recorded: int
    shots_valid: int | None

    @property
    def active(self) -> bool:
        """It is being recorded."""
        return self.outcome == "active"


@dataclass(frozen=True)
class Alarm(_Told):
    """What is wrong, and what to do; ``latched``: to acknowledge it clears a fault."""

    id: str
    source: str
    severe: bool
    text: str
    remedy: str
    latched: bool
    acknowledged: bool


@dataclass(frozen=True)
class Event(_Told):
    """Something that happened; ``data`` differs by ``name``."""

    id: int
    name: str
    time_utc: str
    data: Mapping[str, Any]
