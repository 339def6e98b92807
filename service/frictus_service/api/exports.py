"""What an export makes, until somebody has taken it; and what a killed service left of one."""

import asyncio
import contextlib
import logging
import shutil
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from fastapi.responses import FileResponse
from starlette.types import Receive, Scope, Send

from frictus_service.api.limits import TAKE_S
from frictus_service.api.requests import SLOWEST_BYTES_S
from frictus_service.durable import left_behind

EXPORT_PREFIX: Final = "frictus-export-"
"""Of folders in the temporary folder of the system."""
_LOG: Final = logging.getLogger(__name__)


class ExportResponse(FileResponse):
    """A file that is there until it is sent, or nobody takes it, or not in time.

    Who takes a few bytes now and then holds a place, and a file, that others wait for.

    Attributes
    ----------
    until_sent : ExitStack
        What is held for it; closed at the end.
    """

    until_sent: ExitStack

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it, and let go."""
        with self.until_sent:  # ends at once: who is cancelled cannot wait
            allowed_s = TAKE_S + Path(self.path).stat().st_size / SLOWEST_BYTES_S
            try:
                async with asyncio.timeout(allowed_s):
                    await super().__call__(scope, receive, send)
            except TimeoutError:  # the server ends the connection of an answer that breaks off
                _LOG.warning("%s was not taken within %.0f s", scope["path"], allowed_s)


def remove_left_exports() -> None:
    """Remove what exports of services that were killed have left."""
    for left in left_behind(Path(tempfile.gettempdir()), EXPORT_PREFIX):
        with contextlib.suppress(OSError):  # somebody else's, or gone already
            shutil.rmtree(left)
