""".haptic of Lofelt and Meta: the signal is what the envelopes say."""

import json

import numpy as np
import pytest
from tests.clients.effect_files.made import haptic
from tests.clients.effect_files.spectra import burst_transform, line, strays, times, transform

from frictus.effect_files import render_effect
from frictus.effect_files.timeline import SHARPNESS_HZ
from frictus.errors import TextureError

LOW_HZ, HIGH_HZ = SHARPNESS_HZ


def test_a_steady_clip_is_one_line() -> None:
    effect = render_effect(haptic([(0.0, 0.6), (1.0, 0.6)], [(0.0, 0.4)]), ".haptic")
    assert line(effect, LOW_HZ + 0.4 * (HIGH_HZ - LOW_HZ)) == pytest.approx(0.6, rel=0.01)
    assert np.mean(effect.signal**2) == pytest.approx(0.6**2 / 2.0, rel=0.01)


def test_envelopes_go_linearly_and_step_where_two_points_share_a_time() -> None:
    points = [(0.2, 0.1), (0.6, 0.9), (0.6, 0.3), (1.0, 0.3)]
    effect = render_effect(haptic(points), ".haptic")
    time_s = times(effect)
    envelope = np.where(time_s < 0.6, np.interp(time_s, [0.0, 0.2, 0.6], [0.0, 0.1, 0.9]), 0.3)
    wanted = envelope * np.sin(2.0 * np.pi * LOW_HZ * time_s)
    assert strays(effect, wanted) < 0.01
    assert f"no frequency is given: {LOW_HZ:g} Hz" in effect.notes


def test_an_emphasis_takes_the_place_of_the_wave() -> None:
    text = haptic([(0.0, 0.5), (0.5, 0.5), (1.0, 0.5)], [(0.0, 0.0)], {1: (1.0, 1.0)})
    effect = render_effect(text, ".haptic")
    time_s = times(effect)
    inside = (time_s >= 0.5) & (time_s < 0.5 + 2.0 / HIGH_HZ)
    wanted = 0.5 * np.sin(2.0 * np.pi * LOW_HZ * time_s)
    wanted[inside] = np.sin(2.0 * np.pi * HIGH_HZ * (time_s[inside] - 0.5))
    assert strays(effect, wanted) < 0.01


def test_an_emphasis_alone_has_the_spectrum_of_two_cycles() -> None:
    text = haptic([(0.0, 0.0), (0.5, 0.0)], [(0.0, 0.5)], {0: (0.7, 0.5)})
    hz = np.linspace(11.0, 900.0, 200)
    found = transform(render_effect(text, ".haptic"), hz)
    wanted = burst_transform(hz, (LOW_HZ + HIGH_HZ) / 2.0, 0.7)
    assert np.max(np.abs(found - wanted)) < 0.01 * np.max(np.abs(wanted))


def test_an_emphasis_at_the_end_is_not_cut() -> None:
    text = haptic([(0.0, 0.2), (0.5, 0.2)], [(0.0, 0.0)], {1: (1.0, 0.0)})
    assert render_effect(text, ".haptic").duration_s == pytest.approx(
        0.5 + 2.0 / LOW_HZ, abs=2e-4
    )


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (json.dumps({"version": {"major": 0}}), "version 0 of .haptic; version 1 is read"),
        ('{"version": {"major": 1}}', "signals: an object was expected"),
        (haptic([]), "amplitude is empty"),
        (haptic([(0.0, 0.5)]), "lasts 0 s"),
        (haptic([(0.0, 0.5), (200.0, 0.5)]), "lasts 200 s; at most 180 s"),
        (haptic([(0.0, 1.5), (1.0, 0.5)]), r"amplitude\[0\]: amplitude 1.5; 0 to 1 accepted"),
        (haptic([(0.5, 0.5), (0.1, 0.5)]), r"amplitude\[1\]: its time is before"),
        (haptic([(0.0, 0.5), (1.0, 0.5)], [(0.0, -0.1)]), r"frequency\[0\]: frequency -0.1"),
        (haptic([(0.0, 0.5), (1.0, 0.5)], None, {0: (2.0, 0.0)}), "emphasis: amplitude 2"),
        (haptic([(0.0, 0.5), (1.0, 0.5)]).replace("0.5", '"a"'), "must be a number"),
    ],
)
def test_what_cannot_be_rendered_is_refused(text: str, complaint: str) -> None:
    with pytest.raises(TextureError, match=complaint):
        render_effect(text, ".haptic")
