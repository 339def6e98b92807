"""Work that tells of itself without end, until whoever started it takes no more."""

from pathlib import Path
from typing import Any

from pydantic import BaseModel

from frictus_service.jobs.process import ParentLink, Work


class Said(BaseModel):
    """A kilobyte of progress."""

    text: str = "x" * 1_000


class ChattyWork(Work):
    """Needs no rig and no study."""

    def carry_out(self, run: Any, parent: ParentLink) -> BaseModel | None:
        """Tell, and note in the folder how often."""
        told = 0
        while True:
            parent.report(Said())
            told += 1
            (self.folder / "told").write_text(str(told), encoding="ascii")


def never(folder: Path) -> None:
    """Stand where `Work` names a function."""
