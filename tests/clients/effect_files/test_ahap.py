"""AHAP: the signal is what the pattern says."""

import numpy as np
import pytest
from tests.clients.effect_files.made import ahap, continuous, curve, event
from tests.clients.effect_files.spectra import burst_transform, line, strays, times, transform

from frictus.effect_files import render_effect
from frictus.effect_files.timeline import SHARPNESS_HZ
from frictus.errors import TextureError

LOW_HZ, HIGH_HZ = SHARPNESS_HZ


def test_a_continuous_event_is_a_sine_of_its_intensity_and_sharpness() -> None:
    text = ahap(continuous(0.0, 1.0, HapticIntensity=0.5, HapticSharpness=0.2))
    effect = render_effect(text, ".ahap")
    assert effect.duration_s == pytest.approx(1.0)
    hz = LOW_HZ + 0.2 * (HIGH_HZ - LOW_HZ)
    assert line(effect, hz) == pytest.approx(0.5, rel=0.01)
    assert np.mean(effect.signal**2) == pytest.approx(0.5**2 / 2.0, rel=0.01)  # nothing else
    assert effect.notes == ()


def test_events_begin_at_their_time_and_add_up() -> None:
    text = ahap(
        continuous(0.0, 1.0, HapticIntensity=0.3, HapticSharpness=0.0),
        continuous(0.5, 0.5, HapticIntensity=0.4, HapticSharpness=1.0),
    )
    effect = render_effect(text, ".ahap")
    time_s = times(effect)
    wanted = 0.3 * np.sin(2.0 * np.pi * LOW_HZ * time_s)
    late = time_s >= 0.5
    wanted[late] += 0.4 * np.sin(2.0 * np.pi * HIGH_HZ * (time_s[late] - 0.5))
    assert strays(effect, wanted) < 0.01


def test_a_transient_has_the_spectrum_of_two_cycles() -> None:
    text = ahap(event("HapticTransient", 0.0, HapticIntensity=0.8, HapticSharpness=0.4),
                continuous(0.4, 0.1, HapticIntensity=0.0))  # fmt: skip
    hz = np.linspace(11.0, 900.0, 200)
    found = transform(render_effect(text, ".ahap"), hz)
    of_hz = LOW_HZ + 0.4 * (HIGH_HZ - LOW_HZ)
    wanted = burst_transform(hz, of_hz, 0.8)
    assert np.max(np.abs(found - wanted)) < 0.01 * np.max(np.abs(wanted))


def test_curves_multiply_intensity_and_add_to_sharpness() -> None:
    text = ahap(
        continuous(0.0, 2.0, HapticIntensity=0.8, HapticSharpness=0.5),
        curve("HapticIntensityControl", 0.5, (0.0, 1.0), (1.0, 0.5)),
        curve("HapticSharpnessControl", 1.0, (0.0, -0.5), (1.0, 0.5)),
    )
    effect = render_effect(text, ".ahap")
    time_s = times(effect)
    amplitude = 0.8 * np.interp(time_s, [0.5, 1.5], [1.0, 0.5])
    middle, span = (LOW_HZ + HIGH_HZ) / 2.0, HIGH_HZ - LOW_HZ
    chirp = LOW_HZ * (time_s - 1.0) + span * (time_s - 1.0) ** 2 / 2.0
    cycles = np.where(time_s < 1.0, middle * time_s, middle + chirp)
    wanted = amplitude * np.sin(2.0 * np.pi * cycles)
    assert strays(effect, wanted) < 0.01


def test_a_parameter_changes_all_events_at_once_until_the_next_does() -> None:
    changes = [
        {"Parameter": {"ParameterID": "HapticIntensityControl", "ParameterValue": v, "Time": t}}
        for t, v in ((0.5, 0.25), (0.75, 1.0))
    ]
    text = ahap(
        *changes,
        continuous(0.0, 1.0, HapticSharpness=0.0),
        event("HapticTransient", 0.6, HapticSharpness=0.0, HapticIntensity=0.0),
    )
    effect = render_effect(text, ".ahap")
    levels = [float(np.max(np.abs(part))) for part in np.split(effect.signal, 4)]
    assert levels == pytest.approx([1.0, 1.0, 0.25, 1.0], rel=0.02)


def test_attack_release_and_decay_shape_an_event() -> None:
    shaped = {"HapticSharpness": 0.0, "AttackTime": 1.0, "ReleaseTime": 1.0}
    effect = render_effect(ahap(continuous(0.0, 2.0, **shaped)), ".ahap")
    assert effect.duration_s == pytest.approx(3.0)  # it fades out after its end
    time_s = times(effect)
    envelope = np.interp(time_s, [0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 1.0, 0.0])
    wanted = envelope * np.sin(2.0 * np.pi * LOW_HZ * time_s)
    assert strays(effect, wanted) < 0.01
    assert "attack and release of 1 are taken for 1 s" in effect.notes
    dying = {"HapticSharpness": 0.0, "DecayTime": 1.0, "Sustained": 0.0}
    effect = render_effect(ahap(continuous(0.0, 2.0, **dying)), ".ahap")
    wanted = np.interp(times(effect), [0.0, 1.0], [1.0, 0.0]) * np.sin(
        2.0 * np.pi * LOW_HZ * times(effect)
    )
    assert strays(effect, wanted) < 0.01


def test_what_is_limited_or_left_out_is_said() -> None:
    text = ahap(
        continuous(0.0, 0.5, HapticIntensity=1.5, HapticSharpness=0.0, AudioVolume=1.0),
        continuous(0.0, 0.5, HapticSharpness=0.0),
        event("AudioCustom", 0.0),
        {"Loop": {}},
    )
    effect = render_effect(text, ".ahap")
    said = "; ".join(effect.notes)
    for part in (
        "1 values beyond their range were limited",
        "AudioCustom: left out, 1 of them",
        "AudioVolume: left out",
        "Loop: left out",
        "up to 2 of full scale: limited to 1",
    ):
        assert part in said
    assert np.max(np.abs(effect.signal)) < 1.1


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "not a JSON document"),
        ("[" * 100_000, "not a JSON document"),
        ("[]", "an object was expected"),
        ("{}", "a list 'Pattern'"),
        ('{"Pattern": []}', "no haptic event"),
        (ahap(event("AudioCustom", 0.0)), "no haptic event .AudioCustom: left out"),
        ('{"Pattern": [{"Event": 3}]}', "Event: an object was expected"),
        (ahap(event("HapticContinuous", 0.0)), "EventDuration is missing"),
        (ahap(continuous(0.0, 1.0)).replace("1.0", "1e999"), "not finite"),
        (ahap(continuous(0.0, 200.0)), "0 to 180 accepted"),
        (ahap(continuous(179.0, 2.0)), "lasts 181 s; at most 180 s"),
        (ahap(event("HapticTransient", -1.0)), "0 to 180 accepted"),
        (ahap(continuous(0.0, 1.0), curve("HapticIntensityControl", 0.0)), "without control"),
        (ahap(*[continuous(0.0, 100.0)] * 40), "more than 1800 s together"),
    ],
)
def test_what_cannot_be_rendered_is_refused(text: str, complaint: str) -> None:
    with pytest.raises(TextureError, match=complaint):
        render_effect(text, ".ahap")
