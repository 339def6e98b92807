"""What an export makes, until somebody has taken it; and what a killed service left of one."""

import contextlib
import shutil
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from fastapi.responses import FileResponse
from starlette.types import Receive, Scope, Send

EXPORT_PREFIX: Final = "frictus-export-"
"""Of folders in the temporary folder of the system."""
LEFT_S: Final = 86_400.0
"""A folder that is so old was left by a service that was killed."""


class ExportResponse(FileResponse):
    """A file that is there until it is sent, or nobody takes it.

    Attributes
    ----------
    until_sent : ExitStack
        What is held for it; closed at the end.
    """

    until_sent: ExitStack

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it, and let go."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self.until_sent.close()  # at once: who is cancelled cannot wait


def remove_left_exports() -> None:
    """Remove what exports of services that were killed have left."""
    for left in Path(tempfile.gettempdir()).glob(f"{EXPORT_PREFIX}*"):
        with contextlib.suppress(OSError):  # somebody else's, or gone already
            if time.time() - left.lstat().st_mtime > LEFT_S:
                shutil.rmtree(left)
