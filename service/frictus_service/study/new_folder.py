"""A folder that appears whole, or not at all."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from frictus_service.durable import sync_folder
from frictus_service.study.errors import StudyError


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Give a folder to write to, which bears its name once the context ends without an error.

    Parameters
    ----------
    folder : Path
        What it is to be called.

    Raises
    ------
    StudyError
        If something bears the name already.
    """
    if folder.exists():
        raise StudyError(f"{folder} exists; choose another name, or delete it first")
    unfinished = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    unfinished.mkdir(parents=True)
    try:
        yield unfinished
        unfinished.rename(folder)
        sync_folder(folder.parent)
    except BaseException:
        shutil.rmtree(unfinished)
        raise
