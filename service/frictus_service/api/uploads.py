"""A study that comes over HTTP: to the disk piece by piece, looked into, then given its name.

It is looked into by a process of its own: a file that anybody made may take the HDF5 library,
and the process that it runs in, down.
"""

import asyncio
import contextlib
import secrets
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Final

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from frictus_service.api.own_process import OwnProcesses
from frictus_service.api.problems import (
    GoneError,
    SlowBodyError,
    StudyExistsError,
    TooLargeError,
)
from frictus_service.api.requests import BODY_S, SLOWEST_BYTES_S
from frictus_service.durable import left_behind, put_in_free_place

MAX_STUDY_BYTES: Final = 4_000_000_000
PIECE_BYTES: Final = 1_000_000
"""Held in memory, and written at once."""
LOOK_S: Final = 60.0
UNFINISHED: Final = ".upload-"
LINGER_S: Final = 5.0
"""Whoever still sends as the connection ends sees it reset, and not the answer."""


async def keep_study(request: Request, folder: Path, name: str, commands: OwnProcesses) -> Path:
    """Take the body of a request as a study into a folder, and return its file.

    Parameters
    ----------
    request : Request
        Its body is the file.
    folder : Path
        Of the studies; made where it is missing.
    name : str
        What the file is to be called; a plain name that was checked.
    commands : OwnProcesses
        By which it is looked into.

    Raises
    ------
    StudyExistsError
        If the folder has something of this name.
    TooLargeError, SlowBodyError, GoneError
        If the body is too large, does not come in time, or ends before its end.
    InvalidError
        If it is no study; the text is that of `frictus study show`.
    OSError
        If the disk refuses.
    """
    place = folder / name
    if place.exists():
        raise _exists(place)
    await run_in_threadpool(_make_room, folder)
    unfinished = folder / f"{UNFINISHED}{secrets.token_hex(4)}.h5"
    try:
        await _receive(request, unfinished)
        asked = ("study", "show", str(unfinished), "--json")
        await run_in_threadpool(commands.run, asked, LOOK_S, unfinished, name)
        await run_in_threadpool(_name, unfinished, place)
    finally:
        unfinished.unlink(missing_ok=True)
    return place


def _exists(place: Path) -> StudyExistsError:
    return StudyExistsError(
        f"there is a study {place.name!r}, and none is replaced: choose another name"
    )


def _make_room(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for left in left_behind(folder, UNFINISHED):
        left.unlink(missing_ok=True)


async def _receive(request: Request, into: Path) -> None:
    announced = request.headers.get("content-length", "")
    if announced.isdecimal() and int(announced[:20]) > MAX_STUDY_BYTES:
        raise _too_large()
    pieces = request.stream()
    try:
        await _write(pieces, into)
    except TimeoutError:
        told = (
            f"a study is to come without a pause of {BODY_S:g} s, and on the whole with "
            f"{SLOWEST_BYTES_S:g} bytes per second at least"
        )
        raise SlowBodyError(told, headers={"Connection": "close"}) from None
    except ClientDisconnect:
        raise GoneError("the connection ended before the body did") from None
    except OSError:  # a full disk: most of the body may be on its way
        with contextlib.suppress(TimeoutError, ClientDisconnect):
            async with asyncio.timeout(LINGER_S):
                async for _ in pieces:
                    pass
        raise


async def _write(pieces: AsyncIterator[bytes], into: Path) -> None:
    clock_s = asyncio.get_running_loop().time
    size_bytes, piece, begun_s = 0, bytearray(), clock_s()
    with into.open("xb") as file:
        async with asyncio.timeout(BODY_S) as deadline:
            async for chunk in pieces:
                size_bytes += len(chunk)
                if size_bytes > MAX_STUDY_BYTES:
                    raise _too_large()
                piece += chunk
                if len(piece) >= PIECE_BYTES:
                    await run_in_threadpool(file.write, bytes(piece))
                    piece.clear()
                # Who sends nothing holds a place that others wait for.
                slowest_s = begun_s + size_bytes / SLOWEST_BYTES_S
                deadline.reschedule(min(clock_s(), slowest_s) + BODY_S)
        await run_in_threadpool(file.write, bytes(piece))


def _too_large() -> TooLargeError:
    return TooLargeError(
        f"the study is larger than {MAX_STUDY_BYTES} bytes: put it into the folder of the "
        "studies on the machine of the service",
        headers={"Connection": "close"},
    )


def _name(unfinished: Path, place: Path) -> None:
    try:
        put_in_free_place(unfinished, place)
    except FileExistsError:  # it came meanwhile, from whichever process
        raise _exists(place) from None
