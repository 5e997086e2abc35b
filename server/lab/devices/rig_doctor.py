"""The doctor for a rig that this server holds: what ``tomoshadow doctor`` asks, but for opening its devices anew."""

from collections.abc import Iterable, Iterator
from threading import Lock

from server.doctor.checkup import Checkup, Status
from server.doctor.doctor_host import check_host
from server.doctor.doctor_rig import check_network
from server.doctor.doctor_scheduler import check_scheduler
from server.lab.devices.device_cards import DeviceCard, device_cards
from server.lab.duty import Health
from server.lab.errors import Conflict
from server.lab.services import Context
from server.rig.config import RigConfig

_STATUS = {Health.OK: Status.OK, Health.WARN: Status.WARN, Health.FAULT: Status.FAIL}
_LOOKING = Lock()
"""It writes to the disk to measure it; two at once would measure each other."""


def examine(context: Context) -> tuple[Checkup, ...]:
    """Look at computer, network and devices; takes some seconds, and makes no light.

    Raises
    ------
    Conflict
        A run or live view is under way, which it would disturb, or somebody looks already.
    """
    status = context.services.acquisition.status()
    if not status.resting:
        raise Conflict(f"the doctor looks between runs only, acquisition is {status.state}: wait for its end")
    if not _LOOKING.acquire(blocking=False):
        raise Conflict("the doctor is looking already: wait some seconds")
    try:
        return tuple(findings(context.services.config, device_cards(context)))
    finally:
        _LOOKING.release()


def findings(config: RigConfig, cards: Iterable[DeviceCard]) -> Iterator[Checkup]:
    """What there is to be said, one after the other."""
    yield from check_host(config.server.data_dir)
    if config.processing.scheduler:
        yield check_scheduler(config.processing)
    for view, one in config.views.items():
        yield check_network(f"network of {view}", one.camera.ip, config.network.packet_bytes)
    yield from (_of_card(card) for card in cards if card.kind != "disk")


def _of_card(card: DeviceCard) -> Checkup:
    who = f"{card.identity.vendor} {card.identity.model}, {card.identity.serial}" if card.identity else ""
    detail = card.detail if who in card.detail else f"{who}, {card.detail}"
    return Checkup(card.name, _STATUS[card.health], detail, card.remedy)
