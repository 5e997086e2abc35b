"""DeviceCard: one device for an operator: who it is, how it is, what it may do, what to do about it. Pure."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from annotated_types import Ge, Le
from pydantic import ConfigDict, Field

from daq.devices import Camera, DeviceIdentity, Rig
from daq.frozen_model import FrozenModel
from daq.run.limits import AcquisitionLimits
from daq.run_plan import PulsePair
from server.lab.desk.alarms import remedy_of
from server.lab.duty import Health, Lamp
from server.lab.services import Context
from server.rig.config import RigConfig

_RECOVERING = ("camera", "generator", "stage")
"""Kinds of devices that are opened again where they were lost."""


class Identity(FrozenModel):
    """Who a device says it is."""

    model_config = ConfigDict(from_attributes=True)

    vendor: Annotated[str, Field(description="maker")]
    model: Annotated[str, Field(description="type")]
    serial: Annotated[str, Field(description="serial number")]
    firmware: Annotated[str, Field(description="version of its program")]


class Limit(FrozenModel):
    """Something that a device permits, or is set to."""

    what: Annotated[str, Field(description="for people")]
    value: Annotated[str, Field(description="with its unit")]


class DeviceCard(FrozenModel):
    """One device, or all work in the background."""

    name: Annotated[str, Field(description="of its lamp")]
    kind: Annotated[str, Field(description="camera, generator, interlock, stage, disk, simulator or work")]
    health: Annotated[Health, Field(description="ok: green; warn: amber, it works or nobody knows; fault: red")]
    detail: Annotated[str, Field(description="what was found, or why nothing was")]
    remedy: Annotated[str, Field(description="what to do about it; empty where nothing is wrong")]
    age_s: Annotated[float | None, Field(description="since the device last answered; null: never, or no device")]
    identity: Annotated[Identity | None, Field(description="null: it has not said, or has none")]
    limits: Annotated[tuple[Limit, ...], Field(description="what it permits, or is set to")]
    can_reconnect: Annotated[bool, Field(description="it can be opened again, and no run is under way")]


def device_cards(context: Context) -> tuple[DeviceCard, ...]:
    """All devices of the rig, and the work in the background as the last one."""
    services, monitor = context.services, context.monitor
    resting, known = services.acquisition.status().resting, monitor.identities
    cards = [
        _card(lamp, known.get(lamp.name), tuple(limits_of(lamp, services.rig, services.config)), resting=resting)
        for lamp in monitor.lamps
    ]
    return (*cards, _work_card([duty.name for duty in context.duties], [duty.lamp for duty in context.duties]))


def limits_of(lamp: Lamp, rig: Rig, config: RigConfig) -> Iterator[Limit]:
    """What the device of a lamp permits, or is set to."""
    match lamp.kind:
        case "camera":
            yield from _of_camera(rig.cameras[lamp.name])
        case "generator":
            yield from _of_generator(config)
        case "interlock" if config.interlock is not None:
            yield Limit(what="input", value=f"{config.interlock.chip}, line {config.interlock.line}")
        case "stage" if rig.stage is not None:
            low_mm, high_mm = rig.stage.range_mm
            yield Limit(what="range", value=f"{low_mm:g} to {high_mm:g} mm")
        case "disk":
            yield Limit(what="folder", value=str(config.server.data_dir))
            yield Limit(what="left free", value=f"{AcquisitionLimits.disk_margin_bytes / 2**20:.0f} MiB")


def _of_camera(camera: Camera) -> Iterator[Limit]:
    (rows, columns), timing = camera.image_shape, camera.timing
    yield Limit(what="image", value=f"{columns} x {rows} px, {camera.bits} bit")
    exposures = f"{timing.exposure_a_ns / 1e3:g} and {timing.exposure_b_ns / 1e3:g} µs"
    yield Limit(what="exposures A, B", value=f"{exposures}, gap {timing.gap_ns} ns")
    yield Limit(what="rate", value=f"at most {1e9 / timing.cycle_ns:.4g} shots/s")


def _of_generator(config: RigConfig) -> Iterator[Limit]:
    fields = PulsePair.model_fields
    yield Limit(what="pulse width", value=f"{_range(fields['width_ns'].metadata)} ns")
    yield Limit(what="separation", value=f"{_range(fields['separation_ns'].metadata)} ns")
    for name, view in config.views.items():
        current = f"at most {view.max_current_a:g} A, nominal {view.nominal_current_a:g} A"
        yield Limit(what=f"LED {name}", value=f"{current}, channel {view.led_channel}")


def _range(bounds: list[Any]) -> str:
    low = next(bound.ge for bound in bounds if isinstance(bound, Ge))
    high = next(bound.le for bound in bounds if isinstance(bound, Le))
    return f"{low} to {high}"


def _card(lamp: Lamp, known: DeviceIdentity | None, limits: tuple[Limit, ...], *, resting: bool) -> DeviceCard:
    return DeviceCard(
        name=lamp.name,
        kind=lamp.kind,
        health=lamp.health,
        detail=lamp.trouble,
        remedy=remedy_of(lamp),
        age_s=lamp.age_s,
        identity=None if known is None else Identity.model_validate(known),
        limits=limits,
        can_reconnect=resting and lamp.kind in _RECOVERING,
    )


def _work_card(names: list[str], lamps: list[Lamp | None]) -> DeviceCard:
    """The loops of the server: those that fail, or that all of them do their work."""
    failing = [lamp for lamp in lamps if lamp is not None]
    detail = "; ".join(f"{lamp.name}: {lamp.detail}" for lamp in failing)
    return DeviceCard(
        name="work in the background",
        kind="work",
        health=Health.FAULT if failing else Health.OK,
        detail=detail or "all of it goes on",
        remedy=remedy_of(failing[0]) if failing else "",
        age_s=None,
        identity=None,
        limits=(Limit(what="what goes on", value=", ".join(names)),),
        can_reconnect=False,
    )


def by_name(cards: tuple[DeviceCard, ...]) -> Mapping[str, DeviceCard]:
    """The same, to look one up."""
    return {card.name: card for card in cards}
