"""The finger in a recording or a study: the same samples for the same tracker as on a rig."""

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from statistics import mode
from typing import Final

import numpy as np

import frictus
from frictus.aligned import AlignedSamples
from frictus.block import Block, Flag
from frictus.keys import FORCE, VOLTAGE
from frictus.messages import EstimateState, Message, ModelState, RigStatus, TouchState
from frictus_hardware.physics.linear import TransferFunction
from frictus_service.calibration.coordinates import Prior
from frictus_service.errors import EstimateError, RecordingError, TrialError
from frictus_service.identification.observation.touch_path import PART_S, path_of
from frictus_service.recording.reader import RecordingReader, State
from frictus_service.recording.samples import Samples
from frictus_service.study.layout import in_time
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import Trial
from frictus_service.tracking.carried import carried
from frictus_service.tracking.model_history import ModelHistory, ModelStep
from frictus_service.tracking.model_in_force import ModelInForce
from frictus_service.tracking.touch_motion import TouchedSamples
from frictus_service.tracking.tracker import STATE_S, Tell, Tracker
from frictus_service.tracking.windows import WindowCutter

_WANTED: Final = {FORCE: "force", VOLTAGE: "voltage"}
LEAST_RATE_HZ: Final = 200.0
"""Slower samples have hardly a band, from 40 Hz to half of the rate; rigs are faster."""


def follow_recording(
    reader: RecordingReader, mount: TransferFunction | None, prior: Prior, tell: Tell
) -> EstimateState:
    """Follow the finger in a recording, as fast as it can be read.

    Parameters
    ----------
    reader : RecordingReader
        Open.
    mount : TransferFunction or None
        Between screen and force sensor, lateral, force to force.
    prior : Prior
        Of a person whose model was not in force.
    tell : callable
        Told the estimate after every half second of the recording.

    Returns
    -------
    EstimateState
        After the last sample.

    Raises
    ------
    RecordingError
        If the recording does not say what rig it is of, or lacks a stream.
    EstimateError
        If its samples are too slow for any band.
    """
    status = next(
        (
            item.message
            for item in reader.items()
            if isinstance(item, State) and isinstance(item.message, RigStatus)
        ),
        None,
    )
    if status is None:
        ending = reader.ending
        why = "" if ending.complete else f": it {ending}"
        raise RecordingError(
            f"{reader.path} holds no status of its rig, so that its screen is unknown{why}"
        )
    cutter = _cutter(status.sample_rate_hz, status.screen_peak_v, mount)
    place = f"{status.site}/{status.rig}"
    tracker = Tracker(cutter, prior, place)
    tracker.begin_anew(prior, reader.info.participant)
    touched, models = TouchedSamples(), ModelHistory()

    def note(message: Message) -> None:
        if isinstance(message, ModelState):
            if models.add(message) is ModelStep.SET:  # of another person, perhaps
                participant = message.model.participant or reader.info.participant
                tracker.begin_anew(Prior.of_person(message.model, prior), participant)
            model = carried(message.model, place)
            tracker.put_in_force(ModelInForce.of(message.etag, model))
        elif isinstance(message, TouchState):
            touched.report(message)

    streams = _Streams(reader, note)
    told_ns = 0
    for part in streams.parts():
        if part.sample_rate_hz != status.sample_rate_hz:  # the rig was started anew
            tracker.leave_out("blocks of another rate")
            continue
        for moved in touched.take(part):
            tracker.take(moved)
        if abs(part.utc_ns - told_ns) >= 1e9 * STATE_S:
            told_ns = part.utc_ns
            tell(tracker.state(part.utc_ns))
    missing = [name for name in _WANTED.values() if name not in streams.seen]
    if missing:
        raise RecordingError(
            f"{reader.path} has no stream {' and '.join(missing)}: force and voltage together "
            "tell a finger's law; record both"
        )
    for moved in touched.rest():
        tracker.take(moved)
    tracker.rest()
    state = tracker.state(told_ns)
    tell(state)
    return state


def _cutter(
    sample_rate_hz: float, screen_peak_v: float, mount: TransferFunction | None
) -> WindowCutter:
    if not sample_rate_hz >= LEAST_RATE_HZ:
        raise EstimateError(
            f"samples at {sample_rate_hz:g} Hz do not show how friction follows the drive: "
            f"{LEAST_RATE_HZ:g} Hz or more are needed"
        )
    return WindowCutter(sample_rate_hz, screen_peak_v, mount)


def follow_study(
    reader: StudyReader,
    prior: Prior,
    tell: Tell,
    late_s: float = 0.0,
    participant: str | None = None,
) -> dict[str, EstimateState]:
    """Follow the fingers of a study, each participant's trials in their order.

    Trials at another sample rate than most of a participant's are left out, and counted.

    Parameters
    ----------
    reader : StudyReader
        Open.
    prior : Prior
        Of a new person.
    tell : callable
        Told the estimate after every trial.
    late_s : float
        By which the times of the positions are taken earlier; beside what the study says.
    participant : str or None
        Who is followed; None: everybody.

    Returns
    -------
    dict of str to EstimateState
        By participant, after the last trial.

    Raises
    ------
    EstimateError
        If somebody's samples are too slow for any band.
    """
    people = dict.fromkeys(each.participant for each in reader.trials)
    return {
        person: _follow_person(reader, person, prior, tell, late_s)
        for person in people
        if participant in (None, person)
    }


def _follow_person(
    reader: StudyReader, person: str, prior: Prior, tell: Tell, late_s: float
) -> EstimateState:
    trials = [each for each in reader.trials if each.participant == person]
    # Windows of two rates do not share their frequencies.
    rate_hz = mode(each.sample_rate_hz for each in trials)
    cutter = _cutter(rate_hz, reader.info.screen_peak_v, reader.info.mount)
    tracker = Tracker(cutter, prior, reader.info.rig)
    tracker.begin_anew(prior, person)
    for run, asked in enumerate(trials):
        if asked.sample_rate_hz != rate_hz:
            tracker.leave_out("a trial at another sample rate than most of this person's")
        else:
            parts: list[AlignedSamples] = []
            with suppress(TrialError):
                trial = in_time(reader.read(asked.id), late_s)
                parts = list(_parts_of(trial, run))
                cutter.skew(trial.force_skew_s)
            if not parts:
                tracker.leave_out("a trial without drive, or damaged")
            for part in parts:
                tracker.take(part)
            tracker.rest()
        state = tracker.state(0)
        tell(state)
    return state


def _parts_of(trial: Trial, run: int) -> Iterator[AlignedSamples]:
    """Yield a trial as samples of a rig, a run of their own; nothing without a drive."""
    if trial.voltage_v is None:
        return
    rate_hz = trial.info.sample_rate_hz
    path = path_of(trial.position_mm, trial.position_t_s, trial.voltage_v.size, rate_hz)
    n_samples = round(PART_S * rate_hz)
    for first in range(0, trial.voltage_v.size, n_samples):
        cut = slice(first, first + n_samples)
        data = {
            "force": trial.force_n[cut].T,
            "voltage": trial.voltage_v[np.newaxis, cut],
            "render": path[:, cut],
        }
        held = {name: rows.astype(np.float32) for name, rows in data.items()}
        yield AlignedSamples(run, first, 0, rate_hz, 0, Flag(0), held)


class _Streams:
    """Deals out what a recording holds in one order to readers of its streams."""

    def __init__(self, reader: RecordingReader, on_state: Callable[[Message], None]) -> None:
        self._items = reader.items()
        self._on_state = on_state
        self._waiting: dict[str, deque[Block]] = {name: deque() for name in _WANTED.values()}
        self.seen: set[str] = set()

    def parts(self) -> Iterator[AlignedSamples]:
        """Yield the samples that all streams have."""
        return frictus.align(**{name: self._blocks(name) for name in _WANTED.values()})

    def _blocks(self, name: str) -> Iterator[Block]:
        waiting = self._waiting[name]
        while True:
            while not waiting:
                item = next(self._items, None)
                if item is None:
                    return
                if isinstance(item, State):
                    self._on_state(item.message)
                elif isinstance(item, Samples) and item.stream in _WANTED:
                    self.seen.add(_WANTED[item.stream])
                    self._waiting[_WANTED[item.stream]].append(item.block())
            yield waiting.popleft()
