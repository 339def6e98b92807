"""HJIF, the JSON form of MPEG haptics (ISO/IEC 23090-31)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from frictus.effect_files.curves import CURVES
from frictus.effect_files.document import LARGEST, items, number, within, word
from frictus.effect_files.timeline import MAX_HZ, FloatArray, RenderedEffect, Timeline
from frictus.effect_files.wavelets import Budget, WaveletBand, wavelet_band
from frictus.errors import TextureError

MAX_KEYFRAMES: Final = 300_000
"""Of all effects together, those of a reference counted each time."""
LEAST_STEP_S: Final = 1e-6
"""Between points of a curve: closer ones have slopes that no number holds."""
BURST_S: Final = 0.022
"""Of a transient: two cycles of a sine, as the reference decoder renders it."""
_OVER_TIME: Final = (
    "Vibrotactile", "Vibration", "Force", "Kinesthetic", "Pressure", "Acceleration", "Velocity",
    "Position", "Other",
)  # fmt: skip
_OVER_DISTANCE: Final = ("Vibrotactile Texture", "Texture", "Stiffness", "Friction")
_Course = tuple[FloatArray, FloatArray]
"""Times since an effect's begin in s, and what holds there; empty where nothing is said."""


@dataclass(frozen=True, slots=True)
class _Piece:
    """One effect of a band, references looked up."""

    where: str
    begin_s: float
    lasts_s: float
    amplitude: _Course
    frequency_hz: _Course
    signal: str
    phase_rad: float


@dataclass(frozen=True, slots=True)
class _Band:
    kind: str
    curve: str
    gain: float
    pieces: list[_Piece]
    keyframes: int

    @property
    def end_s(self) -> float:
        """Where its last effect ends, s."""
        return max(piece.begin_s + piece.lasts_s for piece in self.pieces)

    def render(self, timeline: Timeline) -> None:
        """Add its effects."""
        for piece in self.pieces:
            if self.kind == "Transient":
                for time_s, value in zip(*piece.amplitude, strict=True):
                    begin_s = piece.begin_s + float(time_s)
                    timeline.burst(begin_s, self.gain * float(value), 2.0 / BURST_S)
                continue
            span, time_s = timeline.span(piece.begin_s, piece.begin_s + piece.lasts_s)
            if self.kind == "VectorialWave":
                rendered = _wave(piece, timeline, time_s)
            else:
                rendered = CURVES[self.curve](time_s, *piece.amplitude)
            timeline.samples[span] += self.gain * rendered


def render_hjif(document: dict[str, Any]) -> RenderedEffect:
    """Render an HJIF document.

    Bands of all types are rendered, all effects of a band, at their positions, references
    through the library. Channels are added, each with its gain,
    mixing coefficient and the perception's unit exponent. Perceptions of other senses are left
    out, which is reported.

    Parameters
    ----------
    document : dict
        As parsed.

    Raises
    ------
    TextureError
        For composite effects; perceptions over distance alone; what is missing or out of
        range.
    """
    bands, notes = _bands_of(document)
    if not bands:
        left_out = f": {'; '.join(notes)}" if notes else ""
        raise TextureError(f"the document holds no band to render{left_out}")
    timeline = Timeline(max(band.end_s for band in bands))
    for band in bands:
        band.render(timeline)
    return timeline.finished(notes)


def _wave(piece: _Piece, timeline: Timeline, time_s: FloatArray) -> FloatArray:
    """Return a vectorial wave: amplitude and frequency go linearly between keyframes."""
    hz = np.interp(time_s, *piece.frequency_hz)
    wave = _BASE_SIGNALS[piece.signal](piece.phase_rad + timeline.phase_of(hz, time_s))
    return wave * np.interp(time_s, *piece.amplitude) if piece.amplitude[0].size else wave


def _bands_of(document: dict[str, Any]) -> tuple[list[_Band | WaveletBand], list[str]]:
    """Return what is rendered, and what is left out."""
    timescale = within(document, "timescale", "document", 1.0, 1e6, 1_000.0)
    bands, notes = list[_Band | WaveletBand](), list[str]()
    channels, left, budget = 0, MAX_KEYFRAMES, Budget()
    for where, perception in items(document, "perceptions", "document"):
        if "tracks" in perception:
            raise TextureError(
                f"{where} has tracks: a draft from before the standard; channels are read"
            )
        modality = word(perception, "perception_modality", where)
        if modality not in _OVER_TIME:
            why = "it is over distance" if modality in _OVER_DISTANCE else "another sense"
            notes.append(f"{where}: {modality} is left out: {why}")
            continue
        exponent = within(perception, "perception_unit_exponent", where, -12.0, 6.0, 0.0)
        library = {
            number(effect, "id", at): effect
            for at, effect in items(perception, "effect_library", where, optional=True)
        }
        for at, channel in items(perception, "channels", where):
            gain = number(channel, "gain", at, 1.0) * 10.0**exponent
            gain *= number(channel, "mixing_coefficient", at, 1.0)
            channels += 1
            for place, band in items(channel, "bands", at):
                if word(band, "band_type", place) == "WaveletWave":
                    if blocks := wavelet_band(band, place, timescale, gain, budget):
                        bands.append(blocks)
                elif (found := _band(band, place, library, timescale, gain, left)).pieces:
                    bands.append(found)
                    left -= found.keyframes
    if channels > 1:
        notes.append(f"{channels} channels are added: a screen has one friction")
    return bands, notes[:20]


def _band(
    band: dict[str, Any],
    where: str,
    library: dict[float, dict[str, Any]],
    timescale: float,
    gain: float,
    left: int,
) -> _Band:
    kind = word(band, "band_type", where)
    if kind not in ("Transient", "VectorialWave", "Curve"):
        raise TextureError(
            f"{where}: band type {kind!r}; Transient, VectorialWave, Curve and WaveletWave are "
            "rendered"
        )
    curve = word(band, "curve_type", where, "Unknown")
    if kind == "Curve" and curve not in CURVES:
        raise TextureError(f"{where}: curve type {curve!r}; {', '.join(CURVES)} are rendered")
    effects = items(band, "effects", where)
    bases = [_basis(effect, at, library) for at, effect in effects]
    listed = (basis.get("keyframes") for basis in bases)
    keyframes = sum(len(frames) for frames in listed if isinstance(frames, list))
    if keyframes > left:
        raise TextureError(
            f"{where}: more than {MAX_KEYFRAMES} keyframes up to here, references included"
        )
    pieces = [
        _piece(basis, at, kind, timescale, within(effect, "position", at, 0.0, LARGEST, 0.0))
        for basis, (at, effect) in zip(bases, effects, strict=True)
        if basis.get("keyframes") != []  # as AHAP converted by the reference encoder has them
    ]
    if kind == "Curve" and curve == "Bezier":
        _check_bezier(pieces)
    return _Band(kind, curve, gain, pieces, keyframes)


def _basis(
    effect: dict[str, Any], where: str, library: dict[float, dict[str, Any]]
) -> dict[str, Any]:
    """Return the effect itself; for a reference that of the library."""
    kind = word(effect, "effect_type", where, "Basis")
    if kind == "Reference":
        found = library.get(number(effect, "id", where))
        if found is None:
            raise TextureError(f"{where}: the library has no effect with its id")
        effect = found
        kind = word(found, "effect_type", f"{where} in the library", "Basis")
    if kind != "Basis":
        raise TextureError(
            f"{where}: effect type {kind!r}; Basis, and Reference to one, are rendered"
        )
    return effect


def _piece(
    effect: dict[str, Any], where: str, kind: str, timescale: float, position: float
) -> _Piece:
    """Return an effect in seconds; `position` in ticks of the timescale.

    Raises
    ------
    TextureError
        If it lacks what its kind of band needs, or a value is out of range.
    """
    frames = items(effect, "keyframes", where)
    positions = [
        within(frame, "relative_position", at, 0.0, LARGEST, 0.0) for at, frame in frames
    ]
    time_s = np.array(positions) / timescale
    amplitude = _course(frames, time_s, "amplitude_modulation")
    frequency_hz = _course(frames, time_s, "frequency_modulation")
    signal = word(effect, "base_signal", where, "Sine")
    if np.any(np.diff(time_s) < 0.0):
        raise TextureError(f"{where}: its keyframes are not in the order of their positions")
    if kind == "VectorialWave":
        _check_wave(where, frequency_hz[1], signal)
    elif amplitude[0].size == 0:
        raise TextureError(f"{where}: no keyframe has an amplitude_modulation")
    if kind == "Curve" and np.any(np.diff(amplitude[0]) < LEAST_STEP_S):
        raise TextureError(f"{where}: two points of a curve at one position, or within 1 µs")
    return _Piece(
        where,
        position / timescale,
        float(time_s[-1]) + (BURST_S if kind == "Transient" else 0.0),
        amplitude,
        frequency_hz,
        signal,
        number(effect, "phase", where, 0.0),
    )


def _check_wave(where: str, hz: FloatArray, signal: str) -> None:
    if signal not in _BASE_SIGNALS:
        raise TextureError(
            f"{where}: base signal {signal!r}; {', '.join(_BASE_SIGNALS)} are rendered"
        )
    if hz.size == 0:
        raise TextureError(f"{where}: no keyframe has a frequency_modulation")
    if np.min(hz) < 0.0 or np.max(hz) > MAX_HZ:
        raise TextureError(
            f"{where}: frequency_modulation {np.min(hz):g} to {np.max(hz):g} Hz; 0 to "
            f"{MAX_HZ:g} Hz are rendered"
        )


def _check_bezier(pieces: list[_Piece]) -> None:
    for piece in pieces:
        count = piece.amplitude[0].size
        if count > 2 and count % 2 == 0:
            raise TextureError(
                f"{piece.where}: a Bezier curve of {count} points; an odd number is rendered: "
                "end, control, end, control, end"
            )


def _course(frames: list[tuple[str, dict[str, Any]]], time_s: FloatArray, name: str) -> _Course:
    held = [frame.get(name) is not None for _, frame in frames]
    value = [number(frame, name, at) for at, frame in frames if frame.get(name) is not None]
    return time_s[np.array(held, dtype=bool)], np.array(value, dtype=float)


def _triangle(phase_rad: FloatArray) -> FloatArray:
    return np.asarray(2.0 / np.pi * np.arcsin(np.sin(phase_rad)))


def _rising(phase_rad: FloatArray) -> FloatArray:
    cycles = phase_rad / (2.0 * np.pi)
    return np.asarray(2.0 * (cycles - np.floor(cycles + 0.5)))


_BASE_SIGNALS: Final[dict[str, Callable[[FloatArray], FloatArray]]] = {
    "Sine": np.sin,
    "Square": lambda phase_rad: np.where(np.sin(phase_rad) >= 0.0, 1.0, -1.0),
    "Triangle": _triangle,
    "SawToothUp": _rising,
    "SawToothDown": lambda phase_rad: -_rising(phase_rad),
}
