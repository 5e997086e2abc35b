"""/api/rig/devices: what every device is and how it is; opening it again; the doctor."""

from typing import Annotated

from fastapi import APIRouter, Path
from pydantic import ConfigDict, Field

from daq.frozen_model import FrozenModel
from server.doctor.checkup import Status
from server.lab.devices.device_cards import DeviceCard, by_name, device_cards
from server.lab.devices.link_budget import LinkBudget, link_budget
from server.lab.devices.rig_doctor import examine
from server.web.api.parameters import ContextOf
from server.web.problems import responses

router = APIRouter(prefix="/api/rig", tags=["rig"])


class Finding(FrozenModel):
    """One thing that the doctor has looked at."""

    model_config = ConfigDict(from_attributes=True)

    name: Annotated[str, Field(description="what was looked at")]
    status: Annotated[Status, Field(description="ok; warn: it works, slower or less surely than it could; fail")]
    detail: Annotated[str, Field(description="what was found, with values and limits")]
    remedy: Annotated[str, Field(description="how to mend it; empty where nothing needs to be mended")]


@router.get("/devices")
def list_devices(context: ContextOf) -> tuple[DeviceCard, ...]:
    """Every device: who it is, how it is, what it permits; the work in the background is the last one."""
    return device_cards(context)


@router.post("/devices/{name}/reconnect", responses=responses(404, 409))
async def reconnect_device(
    name: Annotated[str, Path(min_length=1, max_length=80, description="of the device, as its lamp is called")],
    context: ContextOf,
) -> DeviceCard:
    """Ask a device now, and open it again if it was lost; between runs only. The answer tells how it is since then."""
    await context.monitor.reconnect(name)
    return by_name(device_cards(context))[name]


@router.get("/network")
def show_network(context: ContextOf) -> LinkBudget:
    """What the images of a shot take of the wires between cameras and computer."""
    return link_budget(context.services.rig.network, context.services.rig.cameras)


@router.post("/doctor", responses=responses(409))
def ask_doctor(context: ContextOf) -> tuple[Finding, ...]:
    """Look at computer, network and devices, for some seconds; between runs only, and without light."""
    return tuple(map(Finding.model_validate, examine(context)))
