"""What ends the light waits for no other request: it has threads of its own."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Answer = TypeVar("Answer")
_THREADS = ThreadPoolExecutor(8, thread_name_prefix="ends the light")
"""The forty that are kept for requests may all wait for a disk, or for a device, that does not answer."""


async def at_once(action: Callable[[], Answer]) -> Answer:
    """Do it outside of the event loop."""
    return await asyncio.get_running_loop().run_in_executor(_THREADS, action)
