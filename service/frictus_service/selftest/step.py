"""The latency of a step: when the monitor moves after a drive was handed over."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.selftest.loop_back import DELAY_SAMPLES, EARLY_SAMPLES
from frictus_service.selftest.playing import PEAK_V, Played, least_lead_ms
from frictus_service.selftest.report import (
    Measure,
    Outcome,
    SelftestFinding,
    beyond,
    judged,
    mean_and_half,
)

TEST: Final = "step latency"
STEPS: Final = 60
HOLD_S: Final = 0.0503
"""No multiple of a block, so that steps fall everywhere in one."""
LEAST_SWING: Final = 0.2
"""Of the drive's; a monitor that swings less has not moved."""


@dataclass(frozen=True, slots=True, eq=False)
class VoltageStaircase:
    """A drive that jumps between zero and a level.

    Attributes
    ----------
    drive_v : ndarray, shape (n_samples,)
    steps : ndarray of int, shape (n_steps,)
        Index of the first sample of each new level.
    """

    drive_v: FloatArray
    steps: NDArray[np.intp]

    @property
    def hold_samples(self) -> int:
        """From one step to the next."""
        return int(self.steps[0])


def staircase(sample_rate_hz: float, peak_v: float = PEAK_V) -> VoltageStaircase:
    """Return steps up and down for three seconds.

    Parameters
    ----------
    sample_rate_hz : float
        Samples per second of the device's clock.
    peak_v : float
        Largest magnitude of screen volts.
    """
    hold = round(HOLD_S * sample_rate_hz)
    steps = hold * np.arange(1, STEPS + 1, dtype=np.intp)
    level = np.arange(STEPS + 1) % 2
    return VoltageStaircase(peak_v * np.repeat(level, hold).astype(np.float64), steps)


def moved_after(
    monitor_v: FloatArray, steps: NDArray[np.intp], hold: int, swing_v: float
) -> FloatArray:
    """Return how many samples after each step the monitor is half-way to its new level.

    Parameters
    ----------
    monitor_v : ndarray, shape (n_samples,)
    steps : ndarray of int, shape (n_steps,)
        Where the drive steps.
    hold : int
        From one step to the next, in samples; a quarter of it on either side is looked at.
    swing_v : float
        Size of the drive's steps.

    Returns
    -------
    ndarray, shape (n_steps,)
        NaN where the monitor does not move.
    """
    quarter = hold // 4
    moved = np.full(steps.size, np.nan)
    for number, step in enumerate(steps):
        before = np.median(monitor_v[step - 2 * quarter : step - quarter])
        after = np.median(monitor_v[step + quarter : step + 2 * quarter])
        if not abs(after - before) >= LEAST_SWING * swing_v:
            continue  # or samples were lost there
        way = (monitor_v[step - quarter : step + quarter] - before) / (after - before)
        moved[number] = int(np.argmax(way >= 0.5)) - quarter
    return moved


def judge_step(
    played: Played, stairs: VoltageStaircase, lead_samples: int, block: int
) -> Outcome:
    """Say how late a rig is, and whether its loop keeps up.

    Parameters
    ----------
    played : Played
        Of the drive of the stairs.
    stairs : VoltageStaircase
        The steps that were played.
    lead_samples : int
        What the rig promises from handing over to playing.
    block : int
        Samples of a block.
    """
    remarks = _lost(played, lead_samples, block)
    steps = played.start + stairs.steps[:-1]
    swing_v = float(np.abs(stairs.drive_v).max())
    moved = moved_after(played.monitor_v, steps, stairs.hold_samples, swing_v)
    seen = moved[np.isfinite(moved)]
    figures = _counts(played, lead_samples)
    if seen.size < max(2, moved.size // 2):
        what = f"the monitor moved with {seen.size} of {moved.size} steps"
        return judged(
            TEST,
            figures,
            [*remarks, SelftestFinding("fail", what, "see the loop-back's monitor")],
            "",
        )
    mean, half = mean_and_half(seen)
    half = max(half, 0.5)  # whole samples are counted
    ms = 1e3 / played.sample_rate_hz
    lead = played.leads[1]
    figures += [
        Measure("monitor moves after play_sample", mean, "samples", half),
        Measure("the latest of them", float(seen.max()), "samples"),
        Measure("from handing over to moving", (lead + mean) * ms, "ms", half * ms),
    ]
    late = "fail" if mean < EARLY_SAMPLES else beyond(float(seen.max()), *DELAY_SAMPLES)
    if late != "ok":
        what = (
            f"the monitor moves {mean:.2f} ± {half:.1g} samples after the step plays, "
            f"{seen.max():g} at most; 0 to {DELAY_SAMPLES[0]:g} are expected"
        )
        remarks.append(SelftestFinding(late, what, "look for a filter in monitor or amplifier"))
    fine = (
        f"a step is on the screen {(lead + mean) * ms:.2f} ± {half * ms:.1g} ms after it was "
        f"handed over; at least {played.margin_samples * ms:.1f} ms of margin were left, "
        f"so that a lead of {_least_ms(played):g} ms would do"
    )
    return judged(TEST, figures, remarks, fine)


def _counts(played: Played, lead_samples: int) -> list[Measure]:
    return [
        Measure("lead promised", lead_samples, "samples"),
        Measure("lead, the longest", played.leads[1], "samples"),
        Measure("margin, the least", played.margin_samples, "samples"),
        Measure("least lead with as much to spare", _least_ms(played), "ms"),
        Measure("underrun", played.underrun_samples, "samples"),
        Measure("overrun", played.overrun_samples, "samples"),
        Measure("blocks offered again", played.retries, ""),
    ]


def _least_ms(played: Played) -> float:
    ms = 1e3 / played.sample_rate_hz
    return least_lead_ms(played.leads[1] * ms, played.margin_samples * ms)


def _lost(played: Played, lead_samples: int, block: int) -> list[SelftestFinding]:
    remarks = []
    to_do = "raise lead_ms; see priority and timer of `frictus doctor`"
    if played.lost_samples:
        what = (
            f"the output had nothing to play for {played.underrun_samples} samples, and "
            f"{played.overrun_samples} sensed samples were lost"
        )
        remarks.append(SelftestFinding("fail", what, to_do))
    elif played.margin_samples < (enough := min(block, lead_samples // 3)):
        what = (
            f"{played.margin_samples} samples of margin were left; {enough} or more are wanted"
        )
        remarks.append(SelftestFinding("warn", what, to_do))
    if played.leads != (lead_samples, lead_samples):
        what = (
            f"blocks play {played.leads[0]} to {played.leads[1]} samples after they are handed "
            f"over; {lead_samples} are promised"
        )
        remarks.append(
            SelftestFinding("fail", what, "report this: the backend breaks its promise")
        )
    return remarks
