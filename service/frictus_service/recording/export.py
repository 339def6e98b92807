"""A recording becomes a `study/1` file: guided trials, or the one that a person declares."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import numpy as np

from frictus.keys import ACCEL, FORCE, VOLTAGE
from frictus.messages import TouchState
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.screen import Screen
from frictus_service.calibration.trial_capture import Stream, TrialCapture
from frictus_service.errors import CaptureError, Exclusion, ExportError
from frictus_service.recording.reader import Ending, Item, RecordingReader, State
from frictus_service.recording.samples import Samples
from frictus_service.recording.segments import (
    Outline,
    TrialDeclaration,
    TrialSegment,
    declared_segment,
    guided_segments,
)
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo
from frictus_service.study.writer import StudyWriter

CAPTURED: Final[dict[int, Stream]] = {FORCE: "force", ACCEL: "accel", VOLTAGE: "voltage"}
AROUND_S: Final = 5.0
"""A trial is followed from so long before it until so long after: streams and states are in
order each, not among each other."""
MAX_SAMPLES: Final = 20_000_000
"""Of one trial, which is held in memory: 1000 s at 20 kHz."""
MOST_BLANK_SWING_V: Final = 5.0
"""Peak to peak that a monitor may show without drive: its noise, and the mains."""
EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class Exported:
    """What came of an export.

    Attributes
    ----------
    trials : tuple of str
        Ids of those that were written.
    excluded : tuple of Exclusion
        What was left out, and why.
    ending : Ending
        How far the recording could be read.
    """

    trials: tuple[str, ...]
    excluded: tuple[Exclusion, ...]
    ending: Ending


def export_study(
    path: Path, out: Path, declared: TrialDeclaration, mount: TransferFunction | None
) -> Exported:
    """Write the trials of a recording as a study; one is in memory at a time.

    Parameters
    ----------
    path : Path
        Recording; where it is torn, what comes before is exported.
    out : Path
        Must not exist.
    declared : TrialDeclaration
        What the recording does not say itself.
    mount : TransferFunction or None
        Between screen and force sensor; no recording knows it.

    Raises
    ------
    RecordingError
        If the file is no recording.
    ExportError
        If it holds no trial that can be used; nothing is written then.
    StudyError
        If `out` exists.
    """
    with RecordingReader(path) as reader:
        outline = Outline.of(reader.items())
        excluded: list[Exclusion] = []
        if outline.guidance:
            segments, excluded = guided_segments(outline, declared)
        else:
            segments = [declared_segment(outline, declared, reader.info.participant)]
        written: list[str] = []
        with StudyWriter(out, _study_of(reader, mount)) as study:
            for found in _trials(reader.items(), segments):
                if isinstance(found, Exclusion):
                    excluded.append(found)
                else:
                    study.add(found)
                    written.append(found.info.id)
            if not written:
                reasons = "; ".join(
                    f"{one.trial}, {one.field}: {one.reason}" for one in excluded
                )
                raise ExportError(f"{path} holds no trial that can be used. {reasons}")
        return Exported(tuple(written), tuple(excluded), reader.ending)


def _study_of(reader: RecordingReader, mount: TransferFunction | None) -> StudyInfo:
    info = reader.info
    status = reader.status
    return StudyInfo(
        rig=info.rig,
        carrier_hz=Screen().carrier_hz,
        screen_peak_v=status.screen_peak_v,
        mount=mount,
        extras={
            "site": info.site,
            "recording": info.name,
            "software": info.software,
            "simulated": int(status.simulated),
            "notes": info.notes,
        },
    )


def _trials(items: Iterator[Item], segments: list[TrialSegment]) -> Iterator[Trial | Exclusion]:
    """Yield the trials in order; each is let go once it is over."""
    waiting = list(segments)
    under_way: list[_Gathering] = []
    for item in items:
        while waiting and _reaches(item, waiting[0]):
            segment = waiting.pop(0)
            if segment.place.n_samples > MAX_SAMPLES:
                yield Exclusion(segment.id, "length", _too_long(segment))
            else:
                under_way.append(_Gathering(segment))
        for gathering in under_way:
            gathering.add(item)
        while under_way and under_way[0].over:
            yield under_way.pop(0).result()
    for gathering in under_way:
        yield gathering.result()
    for segment in waiting:
        yield Exclusion(segment.id, "samples", "the recording ends before it")


class _Gathering:
    """Gathers one trial."""

    def __init__(self, segment: TrialSegment) -> None:
        place = segment.place
        self._segment = segment
        self._capture = TrialCapture(place.first_sample, place.n_samples, place.sample_rate_hz)
        self._pending = set(CAPTURED)
        self._until = place.end_sample + AROUND_S * place.sample_rate_hz

    @property
    def over(self) -> bool:
        """Whether nothing of it can come any more."""
        return not self._pending

    def add(self, item: Item) -> None:
        """Take what belongs to the trial."""
        if isinstance(item, Samples) and item.stream in CAPTURED:
            if item.run != self._segment.place.run or item.first_sample > self._until:
                self._pending.discard(item.stream)
            else:
                self._capture.add_block(CAPTURED[item.stream], item.block())
        elif isinstance(item, State) and isinstance(item.message, TouchState):
            if item.message.run == self._segment.place.run:
                self._capture.add_touch(item.message)

    def result(self) -> Trial | Exclusion:
        """Return the trial, or why it cannot be used."""
        segment = self._segment
        info = TrialInfo(
            id=segment.id,
            participant=segment.participant,
            session=segment.session,
            order=segment.order,
            speed_mm_s=segment.speed_mm_s,
            force_n=segment.force_n,
            tones_hz=tuple(tone for tone in segment.tones_hz if tone > 0.0),
            drive_vpp=0.0,
            sample_rate_hz=segment.place.sample_rate_hz,
            started_utc="",
        )
        try:
            trial = self._capture.trial(info)
        except CaptureError as error:
            return Exclusion(segment.id, "samples", str(error))
        started = EPOCH + timedelta(microseconds=self._capture.utc_ns // 1_000)
        swing_v = _swing(trial)
        driven = bool(info.tones_hz) or segment.texture
        if not driven and swing_v > MOST_BLANK_SWING_V:
            return Exclusion(
                segment.id,
                "tone_hz",
                f"is 0, but the screen was driven with {swing_v:.0f} V peak to peak: a blank "
                "trial is recorded without drive; say which tones were played, or that a "
                "texture was, or use another recording",
            )
        drive_vpp = swing_v if driven else 0.0
        told = replace(info, drive_vpp=drive_vpp, started_utc=started.isoformat())
        return replace(trial, info=told)


def _swing(trial: Trial) -> float:
    """Return the peak-to-peak voltage that the monitor saw; 0 where it saw nothing."""
    if trial.voltage_v is None or not np.isfinite(trial.voltage_v).any():
        return 0.0
    return round(float(np.nanmax(trial.voltage_v) - np.nanmin(trial.voltage_v)), 3)


def _reaches(item: Item, segment: TrialSegment) -> bool:
    """Return whether a trial is near, so that it has to be followed from now on."""
    place = segment.place
    near = place.first_sample - AROUND_S * place.sample_rate_hz
    if isinstance(item, Samples):
        return item.run == place.run and item.end_sample > near
    if isinstance(item, State) and isinstance(item.message, TouchState):
        return item.message.run == place.run and item.message.sample > near
    return False


def _too_long(segment: TrialSegment) -> str:
    place = segment.place
    return (
        f"{place.n_samples / place.sample_rate_hz:.0f} s; at most "
        f"{MAX_SAMPLES / place.sample_rate_hz:.0f} s make a trial: cut it by --from and --until"
    )
