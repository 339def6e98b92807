"""HJIF: bands, keyframes, references, curves."""

import json
from typing import Any

import numpy as np
import pytest
from tests.clients.effect_files.made import band, basis, hjif, keyframes
from tests.clients.effect_files.spectra import burst_transform, line, strays, times, transform

from frictus.effect_files import render_effect
from frictus.errors import TextureError

STEADY = keyframes((0, 0.5, 100), (1_000, 0.5, 100))


@pytest.mark.parametrize(
    ("signal", "harmonics"),
    [
        ("Sine", {1: 1.0, 2: 0.0, 3: 0.0}),
        ("Square", {1: 4.0 / np.pi, 2: 0.0, 3: 4.0 / (3.0 * np.pi)}),
        ("Triangle", {1: 8.0 / np.pi**2, 2: 0.0, 3: 8.0 / (9.0 * np.pi**2)}),
        ("SawToothUp", {1: 2.0 / np.pi, 2: 1.0 / np.pi, 3: 2.0 / (3.0 * np.pi)}),
        ("SawToothDown", {1: 2.0 / np.pi, 2: 1.0 / np.pi, 3: 2.0 / (3.0 * np.pi)}),
    ],
)
def test_the_base_signals_have_their_harmonics(
    signal: str, harmonics: dict[int, float]
) -> None:
    text = hjif(band("VectorialWave", basis(0, STEADY, base_signal=signal)))
    effect = render_effect(text, ".hjif")
    for number, share in harmonics.items():
        assert line(effect, 100.0 * number) == pytest.approx(0.5 * share, rel=0.01, abs=0.005)


def test_a_saw_tooth_rises_or_falls() -> None:
    for signal, sign in (("SawToothUp", 1.0), ("SawToothDown", -1.0), ("Triangle", 1.0)):
        text = hjif(band("VectorialWave", basis(0, STEADY, base_signal=signal)))
        assert sign * render_effect(text, ".hjif").signal[10] > 0.0


def test_phase_and_chirp_are_continuous() -> None:
    frames = keyframes((0, 1.0, 50), (500, None, 150), (1_000, 0.2, None))
    text = hjif(band("VectorialWave", basis(0, frames, base_signal="Sine", phase=np.pi / 2.0)))
    effect = render_effect(text, ".hjif")
    time_s = times(effect)
    rising = 50.0 * time_s + 100.0 * time_s**2
    cycles = np.where(time_s < 0.5, rising, 50.0 + 150.0 * (time_s - 0.5))
    wanted = (1.0 - 0.8 * time_s) * np.cos(2.0 * np.pi * cycles)
    assert strays(effect, wanted) < 0.01


def test_effects_follow_one_another_and_references_repeat_them() -> None:
    tone = basis(0, keyframes((0, 0.5, 200), (100, 0.5, 200)), base_signal="Sine", id=7)
    again = [{"effect_type": "Reference", "id": 7, "position": at} for at in (200, 400)]
    text = hjif(band("VectorialWave", basis(0, tone["keyframes"]), *again), library=[tone])
    effect = render_effect(text, ".hjif")
    assert effect.duration_s == pytest.approx(0.5)
    time_s = times(effect)
    sounding = (time_s % 0.2) < 0.1
    wanted = np.where(sounding, 0.5 * np.sin(2.0 * np.pi * 200.0 * time_s), 0.0)
    assert strays(effect, wanted) < 0.01


def test_a_transient_band_has_the_spectrum_of_two_cycles_in_22_ms() -> None:
    silence = basis(0, keyframes((0, 0.0, 100), (500, 0.0, 100)))
    knock = basis(0, keyframes((0, 0.9, None)))
    text = hjif(band("Transient", knock), band("VectorialWave", silence))
    hz = np.linspace(11.3, 900.0, 200)
    found = transform(render_effect(text, ".hjif"), hz)
    wanted = burst_transform(hz, 2.0 / 0.022, 0.9)
    assert np.max(np.abs(found - wanted)) < 0.01 * np.max(np.abs(wanted))


def test_gains_channels_and_units_are_applied_and_told() -> None:
    document = json.loads(hjif(band("VectorialWave", basis(0, STEADY))))
    perception = document["perceptions"][0]
    (channel,) = perception["channels"]
    perception["perception_unit_exponent"] = -1
    perception["channels"] = [channel | {"gain": 6.0}, channel | {"mixing_coefficient": 2.0}]
    document["perceptions"].append({"perception_modality": "Temperature"})
    document["perceptions"].append({"perception_modality": "Stiffness"})
    effect = render_effect(json.dumps(document), ".hjif")
    assert line(effect, 100.0) == pytest.approx(0.5 * 0.1 * (6.0 + 2.0), rel=0.01)
    said = "; ".join(effect.notes)
    assert "2 channels are added" in said
    assert "Temperature is left out: another sense" in said
    assert "Stiffness is left out: it is over distance" in said


def test_ticks_are_those_of_the_timescale() -> None:
    text = hjif(band("VectorialWave", basis(0, STEADY))).replace('1000, "per', '2000, "per')
    effect = render_effect(text, ".hjif")
    assert effect.duration_s == pytest.approx(0.5)
    assert line(effect, 100.0) == pytest.approx(0.5, rel=0.01)


@pytest.mark.parametrize("kind", ["Linear", "Cubic", "Akima"])
def test_a_curve_goes_through_its_points(kind: str, rng: np.random.Generator) -> None:
    ticks, value = np.arange(0, 500, 50), rng.uniform(-0.8, 0.8, 10)
    value[-1] = value[0]  # led to its begin, or the seam would ring
    frames = keyframes(*((int(at), float(v), None) for at, v in zip(ticks, value, strict=True)))
    effect = render_effect(hjif(band("Curve", basis(0, frames), curve_type=kind)), ".hjif")
    at = np.round(ticks[:-1] * effect.sample_rate_hz / 1_000).astype(int)
    np.testing.assert_allclose(effect.signal[at], value[:-1], atol=0.02)


@pytest.mark.parametrize("kind", ["Bezier", "Bspline"])
def test_three_points_are_one_parabola(kind: str) -> None:
    frames = keyframes((0, 0.2, None), (250, 0.8, None), (500, 0.2, None))
    effect = render_effect(hjif(band("Curve", basis(0, frames), curve_type=kind)), ".hjif")
    u = times(effect) / 0.5
    assert strays(effect, 0.2 + 1.2 * u * (1.0 - u)) < 0.01


def test_references_cannot_multiply_a_document_beyond_bounds() -> None:
    long = basis(0, keyframes(*((at, 1.0, 100) for at in range(2_000))), id=1)
    again = {"effect_type": "Reference", "id": 1}
    text = hjif(*(band("VectorialWave", *[again] * 100) for _ in range(2)), library=[long])
    with pytest.raises(TextureError, match=r"bands\[1\]: more than 300000 keyframes"):
        render_effect(text, ".hjif")


def changed(**more: Any) -> str:
    """Return a document whose only effect has changed."""
    return hjif(band("VectorialWave", basis(0, STEADY) | more))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("{}", "a list 'perceptions'"),
        ('{"perceptions": []}', "no band to render"),
        ('{"perceptions": [{"tracks": []}]}', "a draft from before the standard"),
        (hjif(perception_modality="Stiffness"), "Stiffness is left out: it is over distance"),
        (hjif(band("Pulse")), r"band type .Pulse.; Transient, .*, Curve and WaveletWave"),
        (hjif(band("Curve", basis(0, STEADY), curve_type="Spline")), "curve type 'Spline'"),
        (hjif(band("Curve", basis(0, [*STEADY] * 2), curve_type="Bezier")), "not in the order"),
        (hjif(band("Curve", basis(0, keyframes(*((at, 1.0, None) for at in range(4)))),
                   curve_type="Bezier")), "a Bezier curve of 4 points; an odd number"),
        (changed(effect_type="Composite"), "'Composite'; Basis, and Reference"),
        (changed(effect_type="Reference", id=3), "the library has no effect with its id"),
        (changed(base_signal="Noise"), "base signal 'Noise'; Sine, Square"),
        (changed(keyframes=keyframes((0, 1.0, None))), "no keyframe has a frequency"),
        (changed(keyframes=keyframes((0, 1.0, 5_000))), "5000 Hz; 0 to 3000 Hz"),
        (changed(keyframes=STEADY[::-1]), "not in the order of their positions"),
        (changed(keyframes=5), "a list 'keyframes'"),
        (changed(position=-5), "position -5"),
        (changed(position=10**9), "lasts 1e[+]06"),
        (hjif(band("Curve", basis(0, keyframes((5, None, 1.0))))), "no keyframe has an"),
        (hjif(band("Curve", basis(0, keyframes((5, 0, None), (5, 1, None))))), "one position"),
        (hjif(band("Curve", basis(0, keyframes((0, 0, None), (1e-300, 1, None))),
                   curve_type="Akima")), "within 1 µs"),
    ],
)  # fmt: skip
def test_what_cannot_be_rendered_is_refused(text: str, complaint: str) -> None:
    with pytest.raises(TextureError, match=complaint):
        render_effect(text, ".hjif")
