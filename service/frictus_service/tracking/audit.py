"""Each change of a model that followed a finger, before and after: a file that only grows."""

import json
import os
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
        """Add a change; it is on the disk when this returns.

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
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
            file.flush()
            os.fsync(file.fileno())
