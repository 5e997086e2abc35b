"""Rig configuration from TOML: frozen, no unknown keys; an error names file, line, key, value and limit."""

import ipaddress
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BeforeValidator,
    Field,
    SecretStr,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from daq.faults import ScriptedFault
from daq.frozen_model import FrozenModel
from daq.names import RigViewName
from processing.errors import BadInput
from processing.runs.toml_lines import line_of
from server.rig.acquisition_config import AcquisitionConfig, NetworkConfig
from server.rig.device_config import InterlockConfig, PulseGeneratorConfig, StageConfig
from server.rig.processing_config import ProcessingConfig

CurrentA = Annotated[float, Field(gt=0, le=30)]


class ConfigError(BadInput):
    """The configuration cannot be used; one line per problem, each with file, line, key, value and limit."""


def _possible(path: object) -> object:
    """A path that a file system can have; an empty one would be the working directory, whichever that is."""
    if not str(path).strip() or "\0" in str(path):
        raise ValueError("no folder has an empty name, or a NUL character in it: name one, or leave the line out")
    return path


class CameraConfig(FrozenModel):
    """Where the camera is, and the profile that makes a double-frame camera of it."""

    ip: Annotated[str, Field(description="IPv4 address; cameras are opened by address, never by discovery")]
    profile: Annotated[Path, Field(description="camera profile, relative to this file")]

    @field_validator("ip")
    @classmethod
    def _is_an_address(cls, ip: str) -> str:
        try:
            return str(ipaddress.IPv4Address(ip))
        except ValueError as error:
            raise ValueError("is no IPv4 address, for example 192.168.10.11") from error

    @field_validator("profile")
    @classmethod
    def _exists(cls, profile: Path, info: ValidationInfo) -> Path:
        resolved = Path((info.context or {}).get("folder", "."), profile)
        if not resolved.is_file():
            raise ValueError(f"there is no file {resolved}")
        return resolved


class LensConfig(FrozenModel):
    """Lens of a view (Table 1)."""

    f_number: Annotated[float, Field(ge=0.7, le=64, description="aperture f#")]
    focal_length_mm: Annotated[float, Field(gt=0, le=2000, description="focal length of the lens")]
    magnification: Annotated[float, Field(gt=0, le=20, description="image size over object size")]


class SensorConfig(FrozenModel):
    """Sensor of a camera."""

    pixel_pitch_um: Annotated[float, Field(ge=0.5, le=100, description="from pixel to pixel; binned ones count as one")]
    width_px: Annotated[int, Field(ge=64, le=16384, description="columns of an image")]
    height_px: Annotated[int, Field(ge=64, le=16384, description="rows of one exposure")]


class ViewConfig(FrozenModel):
    """One line of sight: camera, lens and light."""

    azimuth_deg: Annotated[float, Field(ge=-180, le=180, description="viewing angle phi around y")]
    roll_deg: Annotated[
        float, Field(ge=-180, le=180, description="how the camera is turned about its axis; 180: it hangs upside down")
    ] = 0.0
    camera: CameraConfig
    led_channel: Annotated[int, Field(ge=0, le=3, description="channel of the pulse generator, light and trigger")]
    lens: LensConfig
    sensor: SensorConfig
    max_current_a: Annotated[CurrentA, Field(description="limit of this LED")]
    nominal_current_a: Annotated[CurrentA, Field(description="what a new plan starts with")]
    max_light_a: Annotated[float, Field(ge=0, le=0.5, description="limit of its continuous light; 0 forbids it")] = 0.0

    @model_validator(mode="after")
    def _nominal_is_permitted(self) -> Self:
        if self.nominal_current_a > self.max_current_a:
            raise ValueError(f"nominal_current_a {self.nominal_current_a} is above max_current_a {self.max_current_a}")
        return self


class TargetConfig(FrozenModel):
    """Calibration target: inner corners of a checkerboard, or dots."""

    kind: Annotated[Literal["checkerboard", "dots"], Field(description="what its points are")] = "checkerboard"
    columns: Annotated[int, Field(ge=3, le=200, description="inner corners or dots along x")] = 23
    rows: Annotated[int, Field(ge=3, le=200, description="inner corners or dots along y")] = 17
    pitch_mm: Annotated[float, Field(gt=0, le=100, description="distance of neighbouring points")] = 1.0


class ServerConfig(FrozenModel):
    """Where the server listens and where runs are kept."""

    host: Annotated[str, Field(description="address to listen at; another than a loopback one needs a token")] = (
        "127.0.0.1"
    )
    port: Annotated[int, Field(ge=1, le=65535, description="TCP port")] = 8080
    abort_port: Annotated[
        int, Field(ge=0, le=65535, description="TCP port of ABORT alone, which needs no token; 0: any free one")
    ] = 0
    data_dir: Annotated[
        Path,
        BeforeValidator(_possible),
        Field(description="folder of runs and calibrations, relative to the working directory"),
    ] = Path("runs")
    token: Annotated[SecretStr | None, Field(description="of operators: asked of every browser and script")] = None
    viewer_token: Annotated[
        SecretStr | None, Field(description="of viewers, who look and abort, and do nothing else; needs token too")
    ] = None

    def moved(self, host: str | None, port: int | None) -> "ServerConfig":
        """The same at another address; ConfigError if that may not be served."""
        changes = {name: value for name, value in (("host", host), ("port", port)) if value is not None}
        try:
            return ServerConfig.model_validate(self.model_dump() | changes)
        except ValidationError as error:
            raise ConfigError("; ".join(map(_told, error.errors()))) from error

    @model_validator(mode="after")
    def _abort_has_a_port_of_its_own(self) -> Self:
        if self.abort_port == self.port:
            raise ValueError(f"abort_port {self.port} is that of all else: choose another one, or 0 for any")
        return self

    @model_validator(mode="after")
    def _viewers_have_a_token_of_their_own(self) -> Self:
        if self.viewer_token is not None and (self.token is None or self.token == self.viewer_token):
            raise ValueError("viewer_token: operators need a token too, another one: set token")
        return self

    @model_validator(mode="after")
    def _an_open_door_has_a_key(self) -> Self:
        if self.token is None and self.host not in ("127.0.0.1", "::1", "localhost"):
            raise ValueError(f"host {self.host} can be reached from the network: set a token")
        return self


class SimulationConfig(FrozenModel):
    """Makes the rig a simulated one: real drivers, simulated devices at the other end of every wire."""

    seed: Annotated[
        int, Field(description="draws the true cameras and the sprays; the same seed, the same laboratory")
    ] = 1
    spray: Annotated[Literal["hollow_cone", "flat_fan"], Field(description="nozzle of the paper")] = "hollow_cone"
    firmware: Annotated[
        Literal["host", "emulated"],
        Field(description="core built for this computer, or the Pico's image in an emulator"),
    ] = "host"
    gpio: Annotated[
        Literal["auto", "chip", "memory"], Field(description="simulated GPIO chip, interlock in memory, or what works")
    ] = "auto"
    numbered: Annotated[
        bool, Field(description="the first pixels of every image tell firing, view and exposure: proof of a recording")
    ] = False
    still: Annotated[
        bool, Field(description="every shot shows what the first one did, at no cost: to measure drivers and recorder")
    ] = False
    faults: Annotated[tuple[ScriptedFault, ...], Field(description="what goes wrong, and at which shot")] = ()


class RigConfig(FrozenModel):
    """Everything that is known about a rig before it is opened."""

    name: Annotated[str, Field(min_length=1, max_length=80, description="of the rig, for people")]
    views: Annotated[
        dict[RigViewName, ViewConfig], Field(min_length=2, max_length=4, description="lines of sight by name")
    ]
    target: TargetConfig = TargetConfig()
    pulse_generator: PulseGeneratorConfig | None = None
    interlock: InterlockConfig | None = None
    stage: StageConfig | None = None
    network: NetworkConfig = NetworkConfig()
    acquisition: AcquisitionConfig = AcquisitionConfig()
    processing: ProcessingConfig = ProcessingConfig()
    server: ServerConfig = ServerConfig()
    simulation: SimulationConfig | None = None

    @property
    def channels(self) -> dict[str, int]:
        """Channel of the pulse generator by view."""
        return {name: view.led_channel for name, view in self.views.items()}

    @model_validator(mode="after")
    def _wires_are_not_shared(self) -> Self:
        wires: dict[str, list[int | str]] = {
            "led_channel": [view.led_channel for view in self.views.values()],
            "camera.ip": [view.camera.ip for view in self.views.values()],
        }
        for what, used in wires.items():
            if twice := {value for value in used if used.count(value) > 1}:
                raise ValueError(f"views: {what} {sorted(twice)} is used by two views")
        return self

    @model_validator(mode="after")
    def _devices_are_complete(self) -> Self:
        if self.simulation is None:
            if missing := [name for name in ("pulse_generator", "interlock") if getattr(self, name) is None]:
                raise ValueError(f"{' and '.join(missing)}: missing; a rig without [simulation] needs it")
            return self
        outside = [v.camera.ip for v in self.views.values() if not ipaddress.IPv4Address(v.camera.ip).is_loopback]
        if outside:
            raise ValueError(f"camera.ip {outside}: cameras of a simulated bench have loopback addresses, 127.x.x.x")
        if unknown := {fault.view for fault in self.simulation.faults} - {None, *self.views}:
            raise ValueError(f"simulation.faults: there is no view {sorted(map(str, unknown))}")
        return self


def load_config(path: Path) -> RigConfig:
    """Read a rig configuration.

    Raises
    ------
    ConfigError
        The file cannot be read, is no TOML, or has values that are out of range or unknown.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
        return RigConfig.model_validate(tomllib.loads(text), context={"folder": Path(path).parent})
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: {error}") from error
    except ValidationError as error:
        raise ConfigError("\n".join(_problem(path, text, problem) for problem in error.errors())) from error


def _told(problem: Any) -> str:
    key = ".".join(map(str, problem["loc"]))
    reason: str = problem["msg"].removeprefix("Value error, ")
    return f"{key} {problem['input']}: {reason}" if key else reason


def _problem(path: Path, text: str, problem: Any) -> str:
    key = ".".join(map(str, problem["loc"]))
    reason = problem["msg"].removeprefix("Value error, ")
    value = "" if isinstance(problem["input"], dict | FrozenModel) else f" {problem['input']!r}"
    line = line_of(text, problem["loc"])
    return f"{path}{f':{line}' if line else ''}: {f'{key}:' if key else ''}{value} {reason}".replace(":  ", ": ")
