"""Work of jobs that needs no rig and no study."""

from pathlib import Path
from typing import Any

from pydantic import BaseModel

from frictus_service.jobs.process import ParentLink, Work


class Said(BaseModel):
    """A kilobyte of progress."""

    text: str = "x" * 1_000


class ChattyWork(Work):
    """Tells of itself without end, until whoever started it takes no more."""

    def carry_out(self, run: Any, parent: ParentLink) -> BaseModel | None:
        """Tell, and note in the folder how often."""
        told = 0
        while True:
            parent.report(Said())
            told += 1
            (self.folder / "told").write_text(str(told), encoding="ascii")


class FilelessWork(Work):
    """Reads a file that has gone."""

    def carry_out(self, run: Any, parent: ParentLink) -> BaseModel | None:
        """Read it."""
        (self.folder / "gone.h5").read_bytes()
        return None


def never(folder: Path) -> None:
    """Stand where `Work` names a function."""
