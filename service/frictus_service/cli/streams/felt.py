"""What the finger feels and how the rig fares, gathered and shown as a live table."""

import math
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from rich.live import Live
from rich.markup import escape
from rich.table import Table

from frictus import Block, Feed, FingerState, Gap, Rig, RigStatus, SceneState, Topics
from frictus.errors import SilenceError
from frictus.keys import spoken_name
from frictus.textures import BAND_HZ
from frictus.watched_rig import StreamName
from frictus_service.cli.options import write_line

T = TypeVar("T")

STREAMS: Final[tuple[StreamName, ...]] = ("force", "accel", "voltage", "truth")
WINDOW_S: Final = 0.25
FRICTION_ROW: Final = {"truth": 4, "force": 0}
"""Where friction stands: simulated rigs tell it; else the lateral force of the sensor."""


@dataclass(frozen=True, slots=True)
class RigSnapshot:
    """One look at a rig.

    Attributes
    ----------
    finger : FingerState or None
        The newest; None before the first.
    status : RigStatus or None
        The newest; None where the rig has told none yet.
    scene : SceneState or None
        The active one, with what was applied.
    friction_rms_n : float or None
        Friction felt, 20 to 1000 Hz, over the last quarter of a second, N rms.
    friction_from : str or None
        `truth`, of a simulated rig, or `force`, from the sensor, mount included.
    received, lost : dict of str to int
        Blocks per stream since the observer was made.
    gaps : dict of str to int
        Gaps by reason, over all streams.
    silent_s : float
        Since a finger state or block came from the rig.
    """

    finger: FingerState | None
    status: RigStatus | None
    scene: SceneState | None
    friction_rms_n: float | None
    friction_from: str | None
    received: dict[str, int]
    lost: dict[str, int]
    gaps: dict[str, int]
    silent_s: float

    def fields(self) -> dict[str, Any]:
        """Return it as what a JSON line holds."""
        status = self.status
        return {
            "finger": self.finger and self.finger.model_dump(),
            "friction_rms_n": self.friction_rms_n,
            "friction_from": self.friction_from,
            "applied_gain": self.scene.applied.gain if self.scene else None,
            "state": status and status.state,
            "owner": status and status.owner,
            "compensation": status and str(status.compensation),
            "fault": status.fault.reason if status and status.fault else None,
            "counters": status and status.counters.model_dump(),
            "timing": status and status.timing.model_dump(),
            "blocks_received": self.received,
            "blocks_lost": self.lost,
            "gaps": self.gaps,
            "silent_s": round(self.silent_s, 3),
        }


class Observer:
    """Gathers what a rig publishes; look at it several times per second.

    Parameters
    ----------
    rig : Rig
        The rig.
    """

    def __init__(self, rig: Rig) -> None:
        self._fingers = rig.fingers(timeout_s=0.0)
        self._statuses = rig.watch(Topics.STATUS, timeout_s=0.0)
        self._scenes = rig.watch(Topics.SCENE, timeout_s=0.0)
        self._blocks = {name: rig.blocks(name, timeout_s=0.0) for name in STREAMS}
        self._recent: dict[str, list[Block]] = {name: [] for name in FRICTION_ROW}
        self._gaps: Counter[str] = Counter()
        self._finger: FingerState | None = None
        self._status: RigStatus | None = None
        self._scene: SceneState | None = None
        self._heard_s = time.monotonic()

    def look(self) -> RigSnapshot:
        """Take what has come since the last look; never waits for more."""
        for finger in self._fingers.drain():
            self._finger = finger
            self._heard_s = time.monotonic()
        for status in _waiting(self._statuses):
            self._status = status if isinstance(status, RigStatus) else self._status
        for scene in _waiting(self._scenes):
            self._scene = scene if isinstance(scene, SceneState) else self._scene
        for name, feed in self._blocks.items():
            for item in _waiting(feed):
                self._take(name, item)
        source = next((name for name in FRICTION_ROW if self._recent[name]), None)
        return RigSnapshot(
            self._finger,
            self._status,
            self._scene,
            _friction_rms_n(self._recent[source], FRICTION_ROW[source]) if source else None,
            source,
            {name: feed.received for name, feed in self._blocks.items()},
            {name: feed.lost for name, feed in self._blocks.items()},
            dict(self._gaps),
            time.monotonic() - self._heard_s,
        )

    def _take(self, name: str, item: Block | Gap) -> None:
        self._heard_s = time.monotonic()
        if isinstance(item, Gap):
            self._gaps[item.reason] += 1
        if name not in self._recent:
            return
        if isinstance(item, Gap):
            self._recent[name].clear()  # a spectrum over a gap would be wrong
            return
        recent = self._recent[name]
        recent.append(item)
        while sum(b.data.shape[1] for b in recent[1:]) >= WINDOW_S * item.sample_rate_hz:
            recent.pop(0)


def band_rms(samples: NDArray[np.floating[Any]], sample_rate_hz: float) -> float | None:
    """Return the root mean square between 20 and 1000 Hz.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        At least 0.1 s of a signal; it is weighted with a Hann window.
    sample_rate_hz : float
        Its rate.

    Returns
    -------
    float or None
        In the unit of the signal; None where it is too short.
    """
    if samples.size < 0.1 * sample_rate_hz:
        return None
    window = np.hanning(samples.size)
    centred = samples - np.mean(samples)
    power = np.abs(np.fft.rfft(window * centred)) ** 2
    hz = np.fft.rfftfreq(samples.size, 1.0 / sample_rate_hz)
    within = (hz >= BAND_HZ[0]) & (hz <= BAND_HZ[1])
    # Parseval, for one-sided power and the window's own power.
    mean_square = 2.0 * np.sum(power[within]) / (samples.size * np.sum(window**2))
    return float(np.sqrt(mean_square))


def _friction_rms_n(blocks: list[Block], row: int) -> float | None:
    if any(block.data.shape[0] <= row for block in blocks):
        return None
    samples = np.concatenate([block.data[row] for block in blocks])
    value = band_rms(samples.astype(np.float64), blocks[-1].sample_rate_hz)
    return value if value is not None and np.isfinite(value) else None


def _waiting(feed: Feed[T]) -> Iterator[T]:
    """Give what waits in a feed that was made with a timeout of 0."""
    try:
        yield from feed
    except SilenceError:
        return


ALARM_S = 1.0


class Display:
    """Shows one look after another: a live table, or JSON lines; a context manager.

    Parameters
    ----------
    title : str
        Heads the table.
    lines : bool
        Write JSON lines instead.
    """

    def __init__(self, title: str, lines: bool) -> None:
        self._title = title
        self._live = None if lines else Live(auto_refresh=False)

    def show(self, felt: RigSnapshot, elapsed_s: float) -> None:
        """Show one look."""
        if self._live is None:
            write_line(event="felt", elapsed_s=round(elapsed_s, 3), **felt.fields())
        else:
            self._live.update(table_of(felt, self._title, elapsed_s), refresh=True)

    def __enter__(self) -> Self:
        """Take the terminal."""
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Give the terminal back; the last table stays."""
        if self._live is not None:
            self._live.stop()


def table_of(felt: RigSnapshot, title: str, elapsed_s: float) -> Table:
    """Return the table of one look."""
    table = Table(title=f"{escape(title)}, {elapsed_s:.1f} s", show_header=False, min_width=60)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for row in (*_finger_rows(felt), *_rig_rows(felt)):
        table.add_row(*row)
    return table


def _finger_rows(felt: RigSnapshot) -> list[tuple[str, str]]:
    finger = felt.finger
    if finger is None:
        return [("finger", "[yellow]no finger state yet[/]")]
    speed = math.hypot(finger.vx_mm_s, finger.vy_mm_s)
    remarks = [
        text
        for holds, text in (
            (not finger.in_contact, "not touching"),
            (finger.stale, "[red]stale sensor[/]"),
            (finger.extrapolated, "[yellow]outside the model's speeds[/]"),
        )
        if holds
    ]
    friction = "-"
    if felt.friction_rms_n is not None:
        friction = (
            f"{1e3 * felt.friction_rms_n:.1f} mN rms, 20 to 1000 Hz ({felt.friction_from})"
        )
    return [
        ("position", f"{finger.x_mm:6.1f}, {finger.y_mm:6.1f} mm  {' '.join(remarks)}"),
        ("speed", f"{speed:6.1f} mm/s"),
        ("normal force", f"{finger.normal_force_n:6.2f} N"),
        ("friction felt", friction),
    ]


def _compensation_rows(status: RigStatus) -> list[tuple[str, str]]:
    """Return a row where what is felt is not what the model makes of it."""
    mode = status.compensation
    if mode.mode == "model":
        return []
    return [("compensation", f"[yellow]{mode}[/]")]


def _rig_rows(felt: RigSnapshot) -> list[tuple[str, str]]:
    rows = []
    if felt.scene is not None:
        applied = felt.scene.applied
        scaled = "  [yellow]scaled to fit the drive[/]" if applied.scaled else ""
        rows.append(("applied gain", f"{applied.gain:.3f}{scaled}"))
    if (status := felt.status) is not None:
        state = f"[red]{status.state}[/]" if status.state == "tripped" else status.state
        fault = f": {status.fault.reason}; {status.fault.action}" if status.fault else ""
        owner = f", held by {spoken_name(status.owner)}" if status.owner else ""
        late, counts = status.timing, status.counters
        rows += [
            ("rig", f"{state}{escape(owner + fault)}"),
            *_compensation_rows(status),
            (
                "loop late",
                f"p50 {late.lateness_p50_ms:.2f}, p99 {late.lateness_p99_ms:.2f}, "
                f"max {late.lateness_max_ms:.2f} ms; least margin {late.margin_min_ms:.1f} of "
                f"{status.lead_ms:g} ms",
            ),
            (
                "loop",
                f"{counts.blocks} blocks, {counts.deadline_misses} late, "
                f"{counts.overruns} overruns, {counts.underruns} underruns, "
                f"{counts.clipped_samples} clipped samples",
            ),
        ]
    received = ", ".join(f"{name} {count}" for name, count in felt.received.items() if count)
    gaps = ", ".join(f"{count} {reason}" for reason, count in felt.gaps.items()) or "no gap"
    lost = sum(felt.lost.values())
    rows.append(("blocks", f"{received or 'none'}; {lost} lost, {gaps}"))
    for note in dict.fromkeys(felt.scene.applied.notes if felt.scene is not None else ()):
        rows.append(("note", f"[yellow]{escape(note)}[/]"))
    if felt.silent_s > ALARM_S:
        rows.append(("", f"[red]nothing from the rig for {felt.silent_s:.0f} s[/]"))
    return rows
