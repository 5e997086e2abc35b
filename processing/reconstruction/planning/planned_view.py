"""PlannedView: how a plan sees a view, in words and numbers that travel with results."""

from typing import Annotated, Literal

from pydantic import Field

from processing.reconstruction.planning.node_view import NodeView
from processing.reconstruction.planning.rectified_view import RectifiedView
from processing.reconstruction.settings import FrozenValue


class PlannedView(FrozenValue):
    """The way from voxels to the image of a view, and how far it is from the calibrated mapping."""

    mapping: Annotated[Literal["rectified", "exact"], Field(description="rectified once, or sampled at nodes")]
    deviation_px: Annotated[float, Field(description="largest distance to the calibrated mapping")]
    node_spacing_voxel: Annotated[int | None, Field(description="from node to node of an exact mapping")] = None
    reason: Annotated[str | None, Field(description="why the view is not rectified, which is faster")] = None

    @classmethod
    def of(cls, view: RectifiedView | NodeView) -> "PlannedView":
        """Description of a view; the deviation to 1e-4 px, so that rounding errors do not tell machines apart."""
        deviation_px = round(view.deviation_px, 4)
        if isinstance(view, RectifiedView):
            return cls(mapping="rectified", deviation_px=deviation_px)
        return cls(mapping="exact", deviation_px=deviation_px, node_spacing_voxel=view.spacing, reason=view.reason)
