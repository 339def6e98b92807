"""`.haptic` of Lofelt and Meta, version 1: envelopes of amplitude and frequency, emphasis."""

from typing import Any

import numpy as np

from frictus.effect_files.document import child, items, number, within
from frictus.effect_files.timeline import (
    SHARPNESS_HZ,
    FloatArray,
    RenderedEffect,
    Timeline,
    burst_s,
    sharpness_hz,
)
from frictus.errors import TextureError


def render_haptic(document: dict[str, Any]) -> RenderedEffect:
    """Render a `.haptic` document.

    One wave whose amplitude and frequency (0 to 1, taken for a sharpness) go linearly from
    breakpoint to breakpoint; the amplitude begins at 0 where nothing else is said of time 0.
    Without a frequency envelope it stays at the lowest frequency. An emphasis is a burst that
    takes the place of the wave.

    Parameters
    ----------
    document : dict
        As parsed.

    Raises
    ------
    TextureError
        If it is of another version, a value is outside 0 to 1, or times fall.
    """
    major = number(child(document, "version", "document"), "major", "version")
    if major != 1:
        raise TextureError(f"version {major:g} of .haptic; version 1 is read")
    signals = child(document, "signals", "document")
    envelopes = child(
        child(signals, "continuous", "signals"), "envelopes", "signals.continuous"
    )
    notes = [
        f"signals.{str(name)[:40]} is left out" for name in signals if name != "continuous"
    ]
    breakpoints = items(envelopes, "amplitude", "envelopes")
    time_s, amplitude = _course(breakpoints, "amplitude")
    if time_s.size == 0:
        raise TextureError("envelopes.amplitude is empty: there is nothing to render")
    if time_s[0] > 0.0:  # as the players of Lofelt do
        time_s, amplitude = np.append(0.0, time_s), np.append(0.0, amplitude)
    # Files may have null in place of a list.
    frequency = items(envelopes, "frequency", "envelopes") if envelopes.get("frequency") else []
    if frequency:
        frequency_s, sharpness = _course(frequency, "frequency")
    else:
        frequency_s, sharpness = np.zeros(1), np.zeros(1)
        notes.append(f"no frequency is given: {SHARPNESS_HZ[0]:g} Hz")
    emphases = [
        _emphasis(where, point) for where, point in breakpoints if point.get("emphasis")
    ]
    ends_s = [begin_s + burst_s(hz) for begin_s, _, hz in emphases]
    timeline = Timeline(max([float(time_s[-1]), *ends_s]))
    where, at_s = timeline.span(0.0, float(time_s[-1]))
    phase = timeline.phase_of(sharpness_hz(np.interp(at_s, frequency_s, sharpness)), at_s)
    timeline.samples[where] = np.interp(at_s, time_s, amplitude) * np.sin(phase)
    for begin_s, _, hz in emphases:
        timeline.samples[timeline.span(begin_s, begin_s + burst_s(hz))[0]] = 0.0
    for begin_s, strength, hz in emphases:
        timeline.burst(begin_s, strength, hz)
    return timeline.finished(notes)


def _course(
    points: list[tuple[str, dict[str, Any]]], name: str
) -> tuple[FloatArray, FloatArray]:
    time_s = np.array([within(point, "time", where, 0.0, 1e6) for where, point in points])
    value = np.array([within(point, name, where, 0.0, 1.0) for where, point in points])
    falls = np.flatnonzero(np.diff(time_s) < 0.0)
    if falls.size:
        where = points[int(falls[0]) + 1][0]
        raise TextureError(f"{where}: its time is before that of the point before it")
    return time_s, value


def _emphasis(where: str, point: dict[str, Any]) -> tuple[float, float, float]:
    emphasis = child(point, "emphasis", where)
    place = f"{where}.emphasis"
    strength = within(emphasis, "amplitude", place, 0.0, 1.0)
    hz = float(sharpness_hz(within(emphasis, "frequency", place, 0.0, 1.0)))
    return number(point, "time", where), strength, hz
