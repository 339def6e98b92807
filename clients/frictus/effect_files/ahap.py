"""AHAP, the patterns of Apple's Core Haptics."""

import bisect
import math
from collections import Counter
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from frictus.effect_files.document import item, items, number, word
from frictus.effect_files.timeline import (
    MAX_DURATION_S,
    FloatArray,
    RenderedEffect,
    Timeline,
    burst_s,
    sharpness_hz,
)
from frictus.errors import TextureError

LONGEST_ENVELOPE_S: Final = 1.0
"""Attack, decay or release at 1: Apple says that they grow exponentially, not to how much."""
_EVENT: Final = {  # what an event may say of itself, and what it is where it does not
    "HapticIntensity": 1.0,
    "HapticSharpness": 0.5,
    "AttackTime": 0.0,
    "DecayTime": 0.0,
    "ReleaseTime": 0.0,
    "Sustained": 1.0,
}
_CONTROL: Final = {  # what may change in the course of a pattern: until it does, and at least
    "HapticIntensityControl": (1.0, 0.0),
    "HapticSharpnessControl": (0.0, -1.0),
    "HapticAttackTimeControl": (0.0, -1.0),
    "HapticDecayTimeControl": (0.0, -1.0),
    "HapticReleaseTimeControl": (0.0, -1.0),
}


@dataclass(frozen=True, slots=True)
class _Event:
    transient: bool
    begin_s: float
    duration_s: float
    values: dict[str, float]


@dataclass(frozen=True, slots=True)
class _Course:
    """A `ParameterCurve`, or a `Parameter` as a curve of one point; it acts until the next."""

    begin_s: float
    time_s: FloatArray
    value: FloatArray


class _Control:
    """One dynamic parameter over the whole pattern."""

    def __init__(self, name: str, courses: list[_Course]) -> None:
        self._default = _CONTROL[name][0]
        self._courses = sorted(courses, key=lambda course: course.begin_s)
        self._begins_s = [course.begin_s for course in self._courses]

    def at(self, time_s: float) -> float:
        """Return its value at one time."""
        begun = bisect.bisect_right(self._begins_s, time_s)
        if begun == 0:
            return self._default
        course = self._courses[begun - 1]
        return float(np.interp(time_s, course.time_s, course.value))

    def sampled(self, timeline: Timeline) -> FloatArray:
        """Return its value at every sample of a timeline."""
        control = np.full(timeline.samples.size, self._default)
        firsts = [math.ceil(begin_s * timeline.rate_hz - 1e-6) for begin_s in self._begins_s]
        for course, first, last in zip(
            self._courses, firsts, [*firsts[1:], control.size], strict=False
        ):
            at_s = np.arange(first, min(last, control.size)) / timeline.rate_hz
            control[first:last] = np.interp(at_s, course.time_s, course.value)
        return control


class _Pattern:
    """Reads the entries of a pattern and counts what it left out or limited."""

    def __init__(self, document: dict[str, Any]) -> None:
        self.events: list[_Event] = []
        self.courses: dict[str, list[_Course]] = {name: [] for name in _CONTROL}
        self.left_out: Counter[str] = Counter()
        self.limited = 0
        for where, entry in items(document, "Pattern", "document"):
            for kind in entry:
                at = f"{where}.{kind[:40]}"
                if kind == "Event":
                    self._event(item(entry[kind], at), at)
                elif kind in ("Parameter", "ParameterCurve"):
                    self._course(item(entry[kind], at), at)
                else:
                    self.left_out[kind[:40]] += 1

    def notes(self) -> list[str]:
        """Return what was left out or limited."""
        notes = [
            f"{name}: left out, {count} of them"
            for name, count in sorted(self.left_out.items())[:10]
        ]
        if len(self.left_out) > len(notes):
            notes.append(f"and {len(self.left_out) - len(notes)} other kinds")
        if self.limited:
            notes.append(f"{self.limited} values beyond their range were limited to it")
        return notes

    def _event(self, event: dict[str, Any], where: str) -> None:
        kind = word(event, "EventType", where)
        if kind not in ("HapticContinuous", "HapticTransient"):
            self.left_out[kind[:40]] += 1
            return
        values = dict(_EVENT)
        for at, parameter in items(event, "EventParameters", where, optional=True):
            name = word(parameter, "ParameterID", at)
            if name in values:
                values[name] = self._limit(number(parameter, "ParameterValue", at), 0.0)
            else:
                self.left_out[name[:40]] += 1
        begin_s = self._time(event, "Time", where)
        transient = kind == "HapticTransient"
        duration_s = 0.0 if transient else self._time(event, "EventDuration", where)
        self.events.append(_Event(transient, begin_s, duration_s, values))

    def _course(self, course: dict[str, Any], where: str) -> None:
        name = word(course, "ParameterID", where)
        if name not in _CONTROL:
            self.left_out[name[:40]] += 1
            return
        begin_s = self._time(course, "Time", where)
        points = [(where, {**course, "Time": 0.0})]
        if "ParameterCurveControlPoints" in course:
            points = items(course, "ParameterCurveControlPoints", where)
        if not points:
            raise TextureError(f"{where}: a curve without control points")
        lowest = _CONTROL[name][1]
        time_s = np.array([begin_s + self._time(point, "Time", at) for at, point in points])
        value = np.array(
            [self._limit(number(point, "ParameterValue", at), lowest) for at, point in points]
        )
        order = np.argsort(time_s, kind="stable")
        self.courses[name].append(_Course(begin_s, time_s[order], value[order]))

    def _time(self, parent: dict[str, Any], name: str, where: str) -> float:
        value = number(parent, name, where, 0.0 if name == "Time" else None)
        if not 0.0 <= value <= MAX_DURATION_S:
            raise TextureError(f"{where}: {name} {value:g} s; 0 to {MAX_DURATION_S:g} accepted")
        return value

    def _limit(self, value: float, low: float) -> float:
        limited = min(max(value, low), 1.0)
        self.limited += limited != value
        return limited


def render_ahap(document: dict[str, Any]) -> RenderedEffect:
    """Render an AHAP document.

    A continuous event is a sine, its amplitude the intensity; a transient is a burst. Dynamic
    parameters and parameter curves act on all events: intensity is multiplied, everything else
    added; a curve goes linearly from point to point, begins to act at its first and holds its
    last value until the next one. As Core Haptics does, values beyond their range are limited
    and unknown keys left out; sounds are left out too. All of it is reported.

    Parameters
    ----------
    document : dict
        As parsed.

    Raises
    ------
    TextureError
        If it holds no haptic event, or something is missing or no number.
    """
    pattern = _Pattern(document)
    notes = pattern.notes()
    if not pattern.events:
        left_out = f" ({'; '.join(notes)})" if notes else ""
        raise TextureError(f"the pattern holds no haptic event{left_out}")
    controls = {name: _Control(name, courses) for name, courses in pattern.courses.items()}
    timeline = Timeline(max(_end_s(event, controls) for event in pattern.events))
    intensity = controls["HapticIntensityControl"].sampled(timeline)
    sharpness = controls["HapticSharpnessControl"].sampled(timeline)
    for event in pattern.events:
        if event.transient:
            strength = controls["HapticIntensityControl"].at(event.begin_s)
            strength *= event.values["HapticIntensity"]
            timeline.burst(event.begin_s, strength, _burst_hz(event, controls))
            continue
        where, time_s = timeline.span(event.begin_s, _end_s(event, controls))
        sharp = np.clip(event.values["HapticSharpness"] + sharpness[where], 0.0, 1.0)
        amplitude = event.values["HapticIntensity"] * intensity[where]
        amplitude *= _envelope(time_s, event, controls)
        timeline.samples[where] += amplitude * np.sin(
            timeline.phase_of(sharpness_hz(sharp), time_s)
        )
    if any(
        event.values["AttackTime"] or event.values["ReleaseTime"] for event in pattern.events
    ):
        notes.append(f"attack and release of 1 are taken for {LONGEST_ENVELOPE_S:g} s")
    return timeline.finished(notes)


def _envelope(time_s: FloatArray, event: _Event, controls: dict[str, _Control]) -> FloatArray:
    """Return attack, decay where nothing sustains it, and release, each linear; 0 to 1."""
    attack_s, decay_s, release_s = (
        _envelope_s(event, controls, name)
        for name in ("AttackTime", "DecayTime", "ReleaseTime")
    )
    envelope = np.minimum(time_s / attack_s, 1.0) if attack_s else np.ones(time_s.size)
    if event.values["Sustained"] < 0.5:
        since_s = np.maximum(time_s - attack_s, 0.0)
        envelope *= np.maximum(1.0 - since_s / decay_s, 0.0) if decay_s else since_s == 0.0
    if release_s:
        over_s = np.maximum(time_s - event.duration_s, 0.0)
        envelope *= np.maximum(1.0 - over_s / release_s, 0.0)
    return envelope


def _end_s(event: _Event, controls: dict[str, _Control]) -> float:
    if event.transient:
        return event.begin_s + burst_s(_burst_hz(event, controls))
    return event.begin_s + event.duration_s + _envelope_s(event, controls, "ReleaseTime")


def _burst_hz(event: _Event, controls: dict[str, _Control]) -> float:
    change = controls["HapticSharpnessControl"].at(event.begin_s)
    sharpness = event.values["HapticSharpness"] + change
    return float(sharpness_hz(min(max(sharpness, 0.0), 1.0)))


def _envelope_s(event: _Event, controls: dict[str, _Control], name: str) -> float:
    change = controls[f"Haptic{name}Control"].at(event.begin_s)
    share = min(max(event.values[name] + change, 0.0), 1.0)
    return LONGEST_ENVELOPE_S * (math.pow(1000.0, share) - 1.0) / 999.0
