"""Guidance and progress of a calibration on a terminal."""

import threading
from typing import Final, Self

from rich.console import Group
from rich.live import Live
from rich.text import Text

from frictus import GuidanceState, Rig
from frictus_service.calibration.job import Progress
from frictus_service.cli.options import write_line

COLUMNS: Final = 60
STYLE: Final = {
    "green": "bold green",
    "yellow": "bold yellow",
    "red": "bold red",
    "grey": "dim",
}
ADVICE: Final = {
    "green": "the force is right",
    "yellow": "press harder",
    "red": "press more lightly",
    "grey": "put your finger on the screen",
}


class Watching:
    """Shows what a rig's guidance says and what `tell` is told; a context manager.

    Parameters
    ----------
    rig : Rig
        An open rig of this client.
    lines : bool
        Write JSON lines, one for each progress, instead.
    """

    def __init__(self, rig: Rig, lines: bool) -> None:
        self._live = None if lines else Live(auto_refresh=False)
        self._feed = rig.guidance()
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._showing = threading.Lock()
        self._progress: Progress | None = None
        self._guidance: GuidanceState | None = None

    def tell(self, progress: Progress) -> None:
        """Take note of how it goes."""
        self._progress = progress
        if self._live is None:
            write_line(event="progress", **progress.model_dump(mode="json"))
        else:
            self._show()

    def _follow(self) -> None:
        for guidance in self._feed:
            self._guidance = guidance
            self._show()

    def _show(self) -> None:
        if self._live is not None:
            with self._showing:
                self._live.update(picture(self._guidance, self._progress), refresh=True)

    def __enter__(self) -> Self:
        """Take the terminal."""
        if self._live is not None:
            self._live.start()
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Give the terminal back; the last picture stays."""
        self._feed.close()
        if self._live is not None:
            self._thread.join()
            self._live.stop()


def picture(guidance: GuidanceState | None, progress: Progress | None) -> Group:
    """Return the reference above the finger, what to do, and how far it is."""
    rows = [] if guidance is None else _cues(guidance)
    return Group(*rows, *([] if progress is None else [_standing(progress)]))


def _cues(guidance: GuidanceState) -> list[Text]:
    if guidance.phase not in ("approach", "record"):
        return [Text(f"{guidance.phase}: lift your finger, {guidance.seconds_left:.0f} s left")]
    style = STYLE[guidance.colour]
    finger = Text(_mark(guidance.x_mm, guidance.span_mm, "■"), style=style)
    speed = "" if guidance.speed_mm_s is None else f"{guidance.speed_mm_s:.0f} "
    force = "" if guidance.force_n is None else f"{guidance.force_n:.2f} "
    return [
        Text(_mark(guidance.reference_x_mm, guidance.span_mm, "□")),
        finger,
        Text(
            f"{guidance.phase} {guidance.seconds_left:4.1f} s   "
            f"speed {speed}of {guidance.target_speed_mm_s:g} mm/s   "
            f"force {force}of {guidance.target_force_n:g} N: {ADVICE[guidance.colour]}",
            style=style,
        ),
    ]


def _mark(x_mm: float | None, span_mm: tuple[float, float], mark: str) -> str:
    if x_mm is None:
        return ""
    share = (x_mm - span_mm[0]) / (span_mm[1] - span_mm[0])
    return " " * round(min(max(share, 0.0), 1.0) * COLUMNS) + mark


def _standing(progress: Progress) -> Text:
    planned = "" if progress.trials_planned is None else f" of {progress.trials_planned}"
    reached = ""
    if progress.precision is not None:
        reached = f", cutoff known to ± {100.0 * progress.precision:.1f} %"
    message = f"; {progress.message}" if progress.message else ""
    return Text(
        f"trials {progress.trials_done}{planned}, rejected {progress.trials_rejected}, "
        f"{progress.recorded_s:.0f} s recorded{reached}{message}"
    )
