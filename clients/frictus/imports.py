"""Haptic effects of other systems, as far as they are textures.

A texture lasts as long as the finger slides; effects that begin, end or change at given times
are not textures and are refused. Amplitudes in these files are relative: `scale_n` says how
many newtons full amplitude stands for. Not read, because they hold no friction: Penn HaTT
models (acceleration of a tool over its speed and force).
"""

import json
import math
from typing import Any, Final

from pydantic import ValidationError

from frictus.errors import TextureError, explain
from frictus.textures import Component, Spectrum

AHAP_SHARPNESS_HZ: Final = (80.0, 230.0)
"""Frequency at sharpness 0 and 1. Apple gives no figure: a convention of this import."""


def read_ahap(text: str, scale_n: float = 1.0) -> Spectrum:
    """Read an Apple AHAP pattern of continuous events that all start together.

    Each becomes a temporal component: intensity times `scale_n`, and a frequency that goes
    linearly with sharpness (`AHAP_SHARPNESS_HZ`). Its duration is dropped: a texture lasts.

    Parameters
    ----------
    text : str
        The file.
    scale_n : float
        Friction amplitude at intensity 1, N.

    Raises
    ------
    TextureError
        For what has no counterpart: transients, audio, curves, envelopes, a sequence.
    """
    pattern = _list(_document(text, "AHAP"), "Pattern")
    components = []
    for number, entry in enumerate(pattern):
        where = f"Pattern[{number}]"
        if not isinstance(entry, dict) or set(entry) != {"Event"}:
            raise TextureError(
                f"{where}: parameter changes over time are no texture; remove it"
            )
        event = _dict(entry, "Event", where)
        if event.get("EventType") != "HapticContinuous":
            raise TextureError(
                f"{where}: {event.get('EventType')!r}; only HapticContinuous is a texture"
            )
        if _number(event, "Time", where, 0.0) != 0.0:
            raise TextureError(f"{where}: starts later; a texture has no sequence")
        values = {"HapticIntensity": 1.0, "HapticSharpness": 0.5}
        for parameter in _list({"EventParameters": [], **event}, "EventParameters", where):
            name = parameter.get("ParameterID") if isinstance(parameter, dict) else None
            if name not in values:
                raise TextureError(f"{where}: parameter {name!r} cannot be represented")
            values[name] = _number(parameter, "ParameterValue", where)
        _within(values["HapticIntensity"], 0.0, 1.0, f"{where}: HapticIntensity")
        _within(values["HapticSharpness"], 0.0, 1.0, f"{where}: HapticSharpness")
        low_hz, high_hz = AHAP_SHARPNESS_HZ
        hz = low_hz + (high_hz - low_hz) * values["HapticSharpness"]
        components.append((values["HapticIntensity"] * scale_n, hz, 0.0))
    return _spectrum(components)


def read_hjif(text: str, scale_n: float = 1.0) -> Spectrum:
    """Read the constant sines of an MPEG haptics file (ISO/IEC 23090-31, JSON form).

    Each band of type `VectorialWave` must hold one effect that starts at 0, of base signal
    `Sine`, whose keyframes all have one amplitude and one frequency in Hz. The perception must
    be `Vibrotactile`; channel gains are applied. The effect's duration is dropped.

    Parameters
    ----------
    text : str
        The file.
    scale_n : float
        Friction amplitude at amplitude 1, N.

    Raises
    ------
    TextureError
        For everything else: wavelets, curves, transients, changing keyframes, libraries, and
        spatial perceptions, whose frequencies would need the standard's distance unit.
    """
    components = []
    for p, perception in enumerate(_list(_document(text, "hjif"), "perceptions")):
        where = f"perceptions[{p}]"
        modality = _item(perception, where).get("perception_modality")
        if modality != "Vibrotactile":
            raise TextureError(f"{where}: modality {modality!r}; only Vibrotactile is read")
        for c, channel in enumerate(_list(perception, "channels", where)):
            at = f"{where}.channels[{c}]"
            gain = _number(_item(channel, at), "gain", at, 1.0)
            for b, band in enumerate(_list(channel, "bands", at)):
                amplitude, hz, phase = _constant_sine(band, f"{at}.bands[{b}]")
                components.append((gain * amplitude * scale_n, hz, phase))
    return _spectrum(components)


def _constant_sine(band: Any, where: str) -> tuple[float, float, float]:
    kind = _item(band, where).get("band_type")
    if kind != "VectorialWave":
        raise TextureError(f"{where}: band type {kind!r}; only VectorialWave is read")
    effects = _list(band, "effects", where)
    if len(effects) != 1:
        raise TextureError(f"{where}: {len(effects)} effects in sequence; one is accepted")
    effect = _item(effects[0], f"{where}.effects[0]")
    if effect.get("effect_type", "Basis") != "Basis" or effect.get("base_signal") != "Sine":
        raise TextureError(
            f"{where}: only effects of type Basis with base signal Sine are read"
        )
    if _number(effect, "position", where, 0.0) != 0.0:
        raise TextureError(f"{where}: starts later; a texture has no sequence")
    frames = [_item(frame, where) for frame in _list(effect, "keyframes", where)]
    amplitudes = _values(frames, "amplitude_modulation", where)
    frequencies = _values(frames, "frequency_modulation", where)
    phase = _number(effect, "phase", where, 0.0) - math.pi / 2.0  # sine as cosine
    return amplitudes, frequencies, phase


def _values(frames: list[dict[str, Any]], name: str, where: str) -> float:
    values = {_number(frame, name, where) for frame in frames if name in frame}
    if len(values) != 1:
        raise TextureError(
            f"{where}: {name} takes {len(values)} values; exactly one is accepted"
        )
    return values.pop()


def _spectrum(components: list[tuple[float, float, float]]) -> Spectrum:
    if not components:
        raise TextureError("the file holds no effect")
    try:
        return Spectrum(
            components=[
                # A negative amplitude is the same sine, half a turn on.
                Component(
                    amplitude_n=abs(amplitude),
                    hz=hz,
                    phase_rad=phase + (math.pi if amplitude < 0.0 else 0.0),
                )
                for amplitude, hz, phase in components
            ]
        )
    except ValidationError as error:
        raise TextureError(explain(error)) from error


def _document(text: str, what: str) -> dict[str, Any]:
    try:
        return _item(json.loads(text), what)
    except (ValueError, RecursionError) as error:
        raise TextureError(f"not an {what} document: {error}") from error


def _item(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise TextureError(f"{where}: an object was expected")
    return value


def _dict(parent: dict[str, Any], name: str, where: str) -> dict[str, Any]:
    return _item(parent.get(name), f"{where}.{name}")


def _list(parent: dict[str, Any], name: str, where: str = "document") -> list[Any]:
    value = parent.get(name)
    if not isinstance(value, list):
        raise TextureError(f"{where}: a list {name!r} was expected")
    return value


def _number(
    parent: dict[str, Any], name: str, where: str, default: float | None = None
) -> float:
    value = parent.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TextureError(f"{where}: {name} must be a number, not {value!r}")
    if not abs(value) <= 1e9:  # refuses NaN and infinity too
        raise TextureError(f"{where}: {name} {value} is not finite, or absurd")
    return float(value)


def _within(value: float, low: float, high: float, what: str) -> None:
    if not low <= value <= high:
        raise TextureError(f"{what} {value}: {low:g} to {high:g} accepted")
