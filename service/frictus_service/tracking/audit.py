"""Each change of a model that followed a finger, before and after: a file that only grows."""

import json
import os
from io import FileIO
from pathlib import Path

from frictus.messages import ModelChange, RigStatus
from frictus.model import Model


class ModelChangeLog:
    """A file with one JSON object in a line for each change.

    Parameters
    ----------
    path : Path
        Made with the first change; folders above it too.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def add(self, status: RigStatus, change: ModelChange, before: Model, after: Model) -> None:
        """Add a change; it is on the disk when this returns, and no part of it when it raises.

        A line that a crash tore is cut off before: another would be glued to it, and lost.

        Parameters
        ----------
        status : RigStatus
            Of the rig whose model it is.
        change : ModelChange
            When, why and by how much.
        before, after : Model
            Whole, so that either can be put in force again.

        Raises
        ------
        OSError
            If the disk refuses.
        """
        line = {
            "site": status.site,
            "rig": status.rig,
            "owner": status.owner,
            **change.model_dump(mode="json"),
            "model_before": before.model_dump(mode="json", by_alias=True),
            "model_after": after.model_dump(mode="json", by_alias=True),
        }
        content = json.dumps(line).encode() + b"\n"
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a+b", buffering=0) as file:
            whole_bytes = _cut_to_whole_lines(file)
            try:
                written = file.write(content)
                if written != len(content):  # a full disk takes what fits
                    raise OSError(
                        f"{self._path}: the disk took {written} of {len(content)} bytes"
                    )
                os.fsync(file.fileno())
            except OSError:
                file.truncate(whole_bytes)
                raise


def _cut_to_whole_lines(file: FileIO) -> int:
    """Cut off what follows the last whole line of a file, and return where that ends."""
    whole_bytes = end = file.seek(0, os.SEEK_END)
    if end:
        file.seek(end - 1)
        if file.read(1) != b"\n":
            file.seek(0)
            whole_bytes = file.read(end).rfind(b"\n") + 1
            file.truncate(whole_bytes)
    return whole_bytes
