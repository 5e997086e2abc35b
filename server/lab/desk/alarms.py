"""AlarmList: what is wrong, one line per cause, each with its remedy; acknowledged one by one."""

import hashlib
from collections.abc import Iterable, Iterator
from typing import Annotated

from pydantic import Field

from daq.causes import Cause
from daq.frozen_model import FrozenModel
from daq.run.refusals import REMEDIES, RefusalCode
from processing.calibration.verdict import Verdict
from server.lab.duty import Health, Lamp
from server.lab.errors import NotFound
from server.lab.watch import CalibrationStanding

_OF_LAMPS = {
    "camera": REMEDIES[RefusalCode.CAMERA_SILENT],
    "generator": REMEDIES[RefusalCode.GENERATOR_SILENT],
    "interlock": REMEDIES[RefusalCode.INTERLOCK_SILENT],
    "stage": "check its cable and supply; it is opened again by itself",
    "disk": REMEDIES[RefusalCode.STORAGE],
    "simulator": "start tomoshadow simulate again; it is found by itself",
    "work": "mend what the text names; it is tried again by itself",
}


class Alarm(FrozenModel):
    """One cause."""

    id: Annotated[str, Field(description="the same as long as the cause is the same")]
    source: Annotated[str, Field(description="device, work, calibration or run")]
    severe: Annotated[bool, Field(description="false: work goes on, but look at it")]
    text: Annotated[str, Field(description="what is wrong")]
    remedy: Annotated[str, Field(description="what to do about it")]
    latched: Annotated[bool, Field(description="to acknowledge it clears a fault of the generator, or of the rig")]
    acknowledged: Annotated[bool, Field(description="an operator has seen it; it is told until it is mended")] = False


class AlarmList:
    """What is wrong, and which of it an operator has seen; any thread."""

    def __init__(self) -> None:
        self._found: tuple[Alarm, ...] = ()
        self._acknowledged: frozenset[str] = frozenset()

    def update(self, found: Iterable[Alarm]) -> tuple[Alarm, ...]:
        """These are the alarms now; that one was acknowledged is forgotten when it is gone."""
        self._found = tuple(found)
        self._acknowledged &= {alarm.id for alarm in self._found}
        return self.now

    @property
    def now(self) -> tuple[Alarm, ...]:
        """All of them."""
        seen = self._acknowledged
        return tuple(alarm.model_copy(update={"acknowledged": alarm.id in seen}) for alarm in self._found)

    def acknowledge(self, alarm_id: str) -> Alarm:
        """An operator has seen this one, and no other; NotFound if it is gone."""
        for alarm in self._found:
            if alarm.id == alarm_id:
                self._acknowledged |= {alarm_id}
                return alarm
        raise NotFound(f"there is no alarm {alarm_id!r} any more")


def of_lamps(lamps: Iterable[Lamp]) -> Iterator[Alarm]:
    """Devices and work with a red lamp; a door that is open is no alarm."""
    for lamp in lamps:
        text = lamp.trouble
        if lamp.health is not Health.FAULT or (lamp.kind == "interlock" and text.startswith("open")):
            continue
        yield _alarm(lamp.name, text.removeprefix(f"{lamp.name}: "), remedy_of(lamp), latched=_is_latched(lamp))


def remedy_of(lamp: Lamp) -> str:
    """What to do about a lamp that is not green; empty for one that is."""
    if lamp.health is Health.OK:
        return ""
    if lamp.kind == "interlock" and lamp.trouble.startswith("open"):
        return REMEDIES[RefusalCode.INTERLOCK_OPEN]
    if lamp.kind == "disk" and lamp.health is Health.WARN:
        return REMEDIES[RefusalCode.DISK_FULL]
    return REMEDIES[RefusalCode.GENERATOR_FAULT] if _is_latched(lamp) else _OF_LAMPS[lamp.kind]


def _is_latched(lamp: Lamp) -> bool:
    return lamp.kind == "generator" and lamp.trouble.startswith("fault")


def of_causes(source: str, causes: Iterable[Cause], *, latched: bool) -> Iterator[Alarm]:
    """Why a run or a live view ended."""
    for cause in causes:
        yield _alarm(source, cause.text, cause.remedy, latched=latched)


def of_calibration(standing: CalibrationStanding | None) -> Iterator[Alarm]:
    """The views have moved since they were calibrated."""
    if standing is None or not standing.is_alarm:
        return
    stops = standing.verdict is Verdict.REFUSE
    worst = standing.worst_view or "a view"
    by = f"{standing.views[worst]:.2f} px" if worst in standing.views else "has moved far"
    title = f"{'RECONSTRUCTION STOPPED' if stops else 'CALIBRATION ALARM'}: {worst} {by}"
    remedy = f"{standing.message} Shots checked: {standing.shots_checked}."
    yield _alarm("calibration", title, remedy, latched=False, severe=stops, what=f"{standing.calibration} {stops}")


def _alarm(source: str, text: str, remedy: str, *, latched: bool, severe: bool = True, what: str = "") -> Alarm:
    digest = hashlib.sha256(f"{source}\n{what or text}".encode()).hexdigest()[:16]
    return Alarm(id=digest, source=source, severe=severe, text=text, remedy=remedy, latched=latched)
