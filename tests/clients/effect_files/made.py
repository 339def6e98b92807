"""Effect files of our own making: none is copied from anywhere."""

import json
from typing import Any


def event(kind: str, time_s: float, duration_s: float = 0.0, **values: float) -> dict[str, Any]:
    """Return one AHAP event; `values` are its parameters."""
    parameters = [
        {"ParameterID": key, "ParameterValue": value} for key, value in values.items()
    ]
    made: dict[str, Any] = {"Time": time_s, "EventType": kind, "EventParameters": parameters}
    return {"Event": made | ({"EventDuration": duration_s} if duration_s else {})}


def continuous(time_s: float, duration_s: float, **values: float) -> dict[str, Any]:
    """Return a continuous AHAP event."""
    return event("HapticContinuous", time_s, duration_s, **values)


def curve(name: str, time_s: float, *points: tuple[float, float]) -> dict[str, Any]:
    """Return an AHAP parameter curve through (time, value)."""
    held = [{"Time": at, "ParameterValue": value} for at, value in points]
    return {
        "ParameterCurve": {
            "ParameterID": name,
            "Time": time_s,
            "ParameterCurveControlPoints": held,
        }
    }


def ahap(*entries: dict[str, Any]) -> str:
    """Return an AHAP document."""
    return json.dumps({"Version": 1.0, "Pattern": entries})


def haptic(
    amplitude: list[tuple[float, float]],
    frequency: list[tuple[float, float]] | None = None,
    emphasis: dict[int, tuple[float, float]] | None = None,
) -> str:
    """Return a .haptic document: breakpoints (time, value), emphases by number of the point."""
    points: list[dict[str, Any]] = [{"time": at, "amplitude": value} for at, value in amplitude]
    for number, (strength, sharpness) in (emphasis or {}).items():
        points[number]["emphasis"] = {"amplitude": strength, "frequency": sharpness}
    envelopes: dict[str, Any] = {"amplitude": points}
    if frequency is not None:
        envelopes["frequency"] = [{"time": at, "frequency": value} for at, value in frequency]
    version = {"major": 1, "minor": 0, "patch": 0}
    return json.dumps({"version": version, "signals": {"continuous": {"envelopes": envelopes}}})


def keyframes(*frames: tuple[float, float | None, float | None]) -> list[dict[str, float]]:
    """Return HJIF keyframes of (ticks, amplitude, Hz)."""
    names = ("relative_position", "amplitude_modulation", "frequency_modulation")
    return [
        {name: value for name, value in zip(names, frame, strict=True) if value is not None}
        for frame in frames
    ]


def basis(position: int, frames: list[dict[str, float]], **more: Any) -> dict[str, Any]:
    """Return an HJIF effect."""
    return {"effect_type": "Basis", "position": position, "keyframes": frames, **more}


def band(kind: str, *effects: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Return an HJIF band."""
    limits = {"lower_frequency_limit": 0, "upper_frequency_limit": 1_000}
    return {"band_type": kind, **limits, "effects": effects, **more}


def hjif(
    *bands: dict[str, Any], library: list[dict[str, Any]] | None = None, **more: Any
) -> str:
    """Return an HJIF document of one vibrotactile perception with one channel."""
    channel = {"id": 0, "gain": 1.0, "mixing_coefficient": 1.0, "bands": bands}
    perception = {
        "id": 0,
        "perception_modality": "Vibrotactile",
        "effect_library": library or [],
        "channels": [channel],
    }
    return json.dumps(
        {"version": "2023", "timescale": 1_000, "perceptions": [perception | more]}
    )
