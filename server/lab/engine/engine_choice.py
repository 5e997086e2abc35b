"""Which engine a rig file asks for."""

from collections.abc import Sequence

from server.lab.engine.cluster_engine import ClusterEngine
from server.lab.engine.dask_engine import DaskEngine
from server.lab.engine.task import Engine
from server.rig.processing_config import ProcessingConfig


def engine_of(processing: ProcessingConfig, modules: Sequence[str]) -> Engine:
    """Workers of this computer, which load some modules at once, or those of a scheduler; not yet started."""
    if processing.scheduler is not None:
        return ClusterEngine(processing)
    return DaskEngine(processing.workers, processing.memory_per_worker, modules)
