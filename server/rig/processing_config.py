"""Where shots become volumes: workers of this computer, or those of a scheduler that other computers serve."""

import ipaddress
import re
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Annotated, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from daq.frozen_model import FrozenModel
from server.rig.certificates import require_certificates

_SCHEDULER = re.compile(r"(?P<protocol>tcp|tls)://(?P<host>\[[0-9a-fA-F:]+\]|[^/:\s]+):(?P<port>\d{1,5})")
MEMORY = r"(auto|\d+(\.\d+)? ?(MB|GB|MiB|GiB))"
_LOCAL_ALONE, _REMOTE_ALONE = ("workers", "memory_per_worker"), ("certificates", "paths")


class ProcessingConfig(FrozenModel):
    """Where shots become volumes: workers of this computer, or those of a scheduler that other computers serve."""

    workers: Annotated[int, Field(ge=1, le=64, description="processes of this computer, each does a job at a time")] = 1
    memory_per_worker: Annotated[
        str,
        Field(
            pattern=rf"^{MEMORY}$",
            description="a process above it is started again, e.g. 4GiB; auto: an equal share",
        ),
    ] = "auto"
    scheduler: Annotated[
        str | None,
        Field(description="tls://HOST:PORT of one whose workers take the place of those of this computer"),
    ] = None
    certificates: Annotated[
        Path | None, Field(description="folder with ca.pem, cert.pem and key.pem, relative to this file")
    ] = None
    paths: Annotated[
        Mapping[str, str], Field(description="folders of this computer, and what workers of the scheduler call them")
    ] = {}
    unreachable_s: Annotated[
        float, Field(ge=1, le=86_400, description="so long a scheduler or its last worker may be away from a job")
    ] = 60.0
    job_deadline_s: Annotated[
        float, Field(ge=1, le=604_800, description="a job of the scheduler has failed that has no result by then")
    ] = 3600.0

    @field_validator("scheduler")
    @classmethod
    def _is_an_address(cls, scheduler: str | None) -> str | None:
        if scheduler is None:
            return None
        found = _SCHEDULER.fullmatch(scheduler)
        if not found or not 0 < int(found["port"]) < 65536:
            raise ValueError("is no address of a scheduler, for example tls://192.168.10.2:8786")
        if found["protocol"] == "tcp" and not is_loopback(found["host"]):
            raise ValueError("leaves this computer without encryption: tls:// and certificates, docs/cluster.md")
        return scheduler

    @field_validator("certificates")
    @classmethod
    def _can_be_used(cls, certificates: Path | None, info: ValidationInfo) -> Path | None:
        if certificates is None:
            return None
        folder = Path((info.context or {}).get("folder", "."), certificates).absolute()
        require_certificates(folder)
        return folder

    @field_validator("paths")
    @classmethod
    def _are_absolute(cls, paths: Mapping[str, str]) -> Mapping[str, str]:
        for path in (*paths, *paths.values()):
            if not PurePosixPath(path).is_absolute():
                raise ValueError(f"{path!r} must begin with /, here and at the workers")
        return paths

    @model_validator(mode="after")
    def _belong_together(self) -> Self:
        if self.scheduler is None:
            if alone := self._said(_REMOTE_ALONE):
                raise ValueError(f"{alone}: of a scheduler, and there is none; name it, or leave it out")
            return self
        if alone := self._said(_LOCAL_ALONE):
            raise ValueError(f"{alone}: of this computer; with a scheduler, tomoshadow worker is told the like")
        if self.scheduler.startswith("tls") and self.certificates is None:
            raise ValueError(f"scheduler {self.scheduler}: needs certificates, the folder of ca.pem, cert.pem, key.pem")
        return self

    def _said(self, names: tuple[str, ...]) -> str:
        """Those of the names that are not left at their defaults."""
        return ", ".join(name for name in names if getattr(self, name) != type(self).model_fields[name].default)


def is_loopback(host: str) -> bool:
    """Whether an address is one that no other computer reaches."""
    try:
        return host == "localhost" or ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
