"""ShotResult: what became of a shot, for whoever asked for its volumes."""

from collections.abc import Mapping

from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.planning.planned_view import PlannedView
from processing.reconstruction.settings import FrozenValue, GridSettings
from processing.runs.results_file import ExposureKey, FrameName
from processing.runs.shots.meetings import Meeting


class VolumeRecord(FrozenValue):
    """One volume; ``seconds`` is the wall time of its reconstruction. ``file`` need not be there: it may be made later.

    ``residuals`` are those of SMART and MART, see ``processing.reconstruction.smart.SmartResult``. ``blind_views``
    see nothing in this exposure, no pixel above the noise floor: a shot may be empty, or a lens be covered.
    ``dim_views`` have no grey value above 1/8 of the full scale: light is missing, or the run states too many bits.
    ``odd_light`` says of a view what does not fit its background or the polarity. ``empty``: no voxel is above 0.
    ``lost_share`` of the sum of all intensities is in voxels that were too faint for bytes. ``meeting`` is what other
    exposures of the run are compared with; of two views there is none. ``light_share`` is the share of its background's
    light that each view has.
    """

    shot: int
    frame: FrameName
    file: str
    seconds: float
    residuals: tuple[float, ...] = ()
    blind_views: tuple[str, ...] = ()
    dim_views: tuple[str, ...] = ()
    odd_light: Mapping[str, str] = {}
    empty: bool = False
    lost_share: float = 0.0
    meeting: Meeting | None = None
    light_share: Mapping[str, float] = {}


class ShotResult(FrozenValue):
    """What became of one shot; ``views`` tells how each view was seen, ``coarse`` that voxels are too wide."""

    shot: int
    method: ReconstructionMethod
    grid: GridSettings
    views: Mapping[str, PlannedView]
    coarse: str = ""
    volumes: tuple[VolumeRecord, ...]
    cpu_s: float
    peak_rss_mb: float

    @property
    def meetings(self) -> dict[ExposureKey, Meeting]:
        """Of its exposures, those that have one."""
        return {(one.shot, one.frame): one.meeting for one in self.volumes if one.meeting}

    @property
    def light(self) -> dict[ExposureKey, Mapping[str, float]]:
        """Of its exposures, by view."""
        return {(one.shot, one.frame): one.light_share for one in self.volumes}
