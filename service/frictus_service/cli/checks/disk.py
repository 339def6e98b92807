"""Whether the disk takes what a rig makes, and for how long."""

import os
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from frictus_service.cli.checks.check import Check, Verdict

BYTES_PER_SAMPLE: Final = 52
"""Force, acceleration, voltage and, where simulated, five channels of truth, as float32, and
a twelfth more for states; converters' counts take less."""
PIECES: Final = 20
SPARE: Final = 5.0
"""A disk less than so many times as fast as the rig leaves little for anything else."""
HOURS: Final = (1.0, 8.0)
"""Time left at which to fail, and to warn."""


def disk_rate(
    folder: Path,
    sample_rate_hz: float,
    now_s: Callable[[], float] = time.perf_counter,
    free_bytes: Callable[[Path], int] = lambda place: shutil.disk_usage(place).free,
) -> Check:
    """Write ten seconds of a rig's streams, synced as a recorder does; the file is deleted.

    Parameters
    ----------
    folder : Path
        Of the recordings; where it is not there yet, the nearest that is takes its place.
    sample_rate_hz : float
        Samples per second of the device's clock.
    now_s, free_bytes : callable
        Clock, and what is left on the disk of a folder.
    """
    from frictus_service.recording.writer import SYNC_S

    place = next(each for each in (folder, *folder.absolute().parents) if each.is_dir())
    rate = BYTES_PER_SAMPLE * sample_rate_hz
    try:
        free = free_bytes(place)
        took_s = _written(place, os.urandom(round(rate * SYNC_S)), now_s)
    except OSError as error:
        to_do = "name another folder in `recordings`, or allow writing to it"
        return Check("disk", "fail", f"{place} cannot be written: {error}", to_do)
    usual_s, worst_s = statistics.median(took_s), max(took_s)
    hours = free / rate / 3600.0
    found = (
        f"{place} takes {1e-6 * rate * SYNC_S / usual_s:.3g} MB/s synced, "
        f"{SYNC_S / usual_s:.3g} times what a rig makes ({1e-6 * rate:.2g} MB/s); the slowest "
        f"of {PIECES} syncs took {1e3 * worst_s:.0f} ms; {1e-9 * free:.3g} GB are free, "
        f"{hours:.3g} h of recording"
    )
    return _judged(found, SYNC_S / usual_s, hours)


def _judged(found: str, times: float, hours: float) -> Check:
    verdict: Verdict = "ok"
    to_do = []
    if not times >= SPARE:
        verdict = "warn" if times >= 1.0 else "fail"
        to_do.append("record to a faster disk of this machine, not over a network")
    if not hours >= HOURS[1]:
        verdict = "fail" if verdict == "fail" or not hours >= HOURS[0] else "warn"
        to_do.append("make room, or name another folder in `recordings`")
    return Check("disk", verdict, found, "; ".join(to_do))


def _written(place: Path, piece: bytes, now_s: Callable[[], float]) -> list[float]:
    """Return how long each piece took to be written and synced."""
    took_s = []
    with tempfile.TemporaryFile(dir=place) as file:
        for _ in range(PIECES):
            begun_s = now_s()
            file.write(piece)
            file.flush()
            os.fsync(file.fileno())
            took_s.append(now_s() - begun_s)
    return took_s
