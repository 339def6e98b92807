"""Excitations: played as they are, continuous, within the drive whatever they fade to."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from frictus.errors import ArgumentError
from frictus.messages import Excitation, Tone
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import Playable, Renderer
from frictus_service.synthesis.scene import MAX_FREE_TONES, compile_excitation, compile_scene

LAW, SCREEN, RATE, BLOCK = FrictionLaw(), Screen(), 20_000.0, 100


def tones(*hz: float, amplitude: float = 0.1, phase: float = 0.3) -> list[Tone]:
    return [Tone(hz=f, amplitude=amplitude, phase_rad=phase + k) for k, f in enumerate(hz)]


def exact(excitation: Excitation, sample: NDArray[np.int64]) -> FloatArray:
    m = np.full(sample.size, excitation.bias)
    for tone in excitation.tones:
        m += tone.amplitude * np.cos(2.0 * np.pi * tone.hz * sample / RATE + tone.phase_rad)
    return m


class Sliding:
    """Renders at a steady speed, from any device sample on."""

    def __init__(self, first: int, playable: Playable | None = None) -> None:
        self.renderer = Renderer(LAW, SCREEN, RATE, BLOCK, playable)
        self.sample = first

    def drive(self, blocks: int, allow: bool = True) -> FloatArray:
        parts = []
        for _ in range(blocks):
            x = 5.0 + 60.0 * self.sample / RATE % 60.0
            course = PredictedMotion(BlockMotion(x, 17.0, 60.0, 0.0, 60.0, 0.0, 60.0, 60.0))
            rendered = self.renderer.render(self.sample, course, allow)
            assert np.all(np.isfinite(rendered.voltage_v))
            parts.append(rendered.drive.copy())
            self.sample += BLOCK
        return np.concatenate(parts)


@pytest.mark.parametrize(
    "excitation",
    [
        Excitation(tones=tones(30.0, 123.456, 1_999.9), bias=0.4),
        Excitation(tones=tones(70.0, 310.0, 1_590.0), bias=0.5, period_s=0.1),
        Excitation(bias=0.7),
    ],
    ids=["free", "periodic", "bias"],
)
def test_the_drive_is_what_was_asked_for(
    excitation: Excitation, rng: np.random.Generator
) -> None:
    first = int(rng.integers(0, 10**9))
    sliding = Sliding(first, compile_excitation(excitation, LAW, RATE))
    sliding.drive(5)
    played = sliding.drive(20)
    at = first + 5 * BLOCK + np.arange(played.size)
    np.testing.assert_allclose(played, exact(excitation, at), atol=2e-6)


def test_nothing_is_aimed_at_or_counted() -> None:
    sliding = Sliding(0, compile_excitation(Excitation(tones=tones(100.0)), LAW, RATE))
    motion = BlockMotion(5.0, 17.0, 5.0, 0.0, 5.0, 0.0, 5.0, 5.0)  # slower than the law's range
    rendered = sliding.renderer.render(0, PredictedMotion(motion), True)
    assert (rendered.clipped_samples, rendered.extrapolated_samples) == (0, 0)
    assert np.all(np.isnan(rendered.target_n))


PLAYABLES = st.one_of(
    st.builds(
        lambda bias, size, hz: compile_excitation(
            Excitation(
                tones=[Tone(hz=hz, amplitude=max(size * min(bias, 1.0 - bias), 1e-9))],
                bias=min(max(bias, 1e-6), 1.0 - 1e-6),
            ),
            LAW,
            RATE,
        ),
        st.floats(0.01, 0.99),
        st.floats(0.0, 1.0),
        st.floats(1.0, 5_000.0),
    ),
    st.builds(
        lambda size, cycles: compile_scene(
            Scene(
                regions=[
                    Region(
                        texture=Spectrum(
                            components=[Component(amplitude_n=size, cycles_per_mm=cycles)]
                        )
                    )
                ]
            ),
            LAW,
            SCREEN,
            RATE,
        ),
        st.floats(1e-3, 5.0),
        st.floats(0.5, 10.0),
    ),
)


@settings(max_examples=40, deadline=None)
@given(
    playables=st.lists(PLAYABLES, min_size=2, max_size=4),
    wait=st.integers(1, 6),
    first=st.integers(0, 10**8),
)
def test_fades_stay_within_the_drive(playables: list[Playable], wait: int, first: int) -> None:
    sliding = Sliding(first, playables[0])
    parts = [sliding.drive(6)]
    for playable in playables[1:]:
        sliding.renderer.set_scene(playable)
        parts.append(sliding.drive(wait))
    parts.append(sliding.drive(8, allow=False))
    drive = np.concatenate(parts)
    assert drive.min() >= 0.0
    assert drive.max() <= 1.0
    assert drive[-1] == 0.0


def test_a_fade_between_scene_and_excitation_takes_20_ms(rng: np.random.Generator) -> None:
    first = int(rng.integers(0, 10**6))
    calm = compile_scene(Scene(), LAW, SCREEN, RATE)
    excited = compile_excitation(Excitation(bias=0.5), LAW, RATE)
    sliding = Sliding(first, calm)
    sliding.drive(5)
    sliding.renderer.set_scene(excited)
    assert sliding.renderer.scene is excited
    up = sliding.drive(5)
    share = np.minimum(np.arange(500) / 400.0, 1.0)
    np.testing.assert_allclose(up, 0.5 * share**2 * (3.0 - 2.0 * share), atol=1e-9)
    sliding.renderer.set_scene(calm)
    np.testing.assert_allclose(sliding.drive(5), 0.5 - up, atol=1e-9)


@pytest.mark.parametrize(
    ("excitation", "words"),
    [
        (Excitation(tones=tones(100.0, amplitude=0.5), bias=0.4), "from -0.1"),
        (Excitation(tones=tones(100.0, amplitude=0.5), bias=0.6, period_s=0.01), "to 1.1"),
        (Excitation(tones=tones(100.0, 130.0), period_s=0.01), "130 Hz is no multiple"),
        (Excitation(tones=tones(100.0), period_s=0.010_02), "whole number"),
        (
            Excitation(tones=tones(*range(100, 100 + MAX_FREE_TONES + 1), amplitude=1e-3)),
            "give the period",
        ),
    ],
)
def test_what_cannot_be_played_is_refused(excitation: Excitation, words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        compile_excitation(excitation, LAW, RATE)


def test_a_tone_above_half_of_the_sample_rate_is_refused() -> None:
    with pytest.raises(ArgumentError, match="below half"):
        compile_excitation(Excitation(tones=tones(1_000.0)), LAW, 2_000.0)


def test_a_period_lets_tones_share_the_drive(rng: np.random.Generator) -> None:
    """What the sum of the amplitudes would refuse, one period of the sum admits."""
    hz = 10.0 * np.arange(7.0, 60.0, 6.0)
    phases = -np.pi * np.arange(hz.size) ** 2 / hz.size  # Schroeder
    many = [
        Tone(hz=float(f), amplitude=0.1, phase_rad=float(p))
        for f, p in zip(hz, phases, strict=True)
    ]
    with pytest.raises(ArgumentError, match=r"from -0\.4"):
        compile_excitation(Excitation(tones=many), LAW, RATE)
    compiled = compile_excitation(Excitation(tones=many, period_s=0.1), LAW, RATE)
    assert compiled.table.min() >= 0.0
    assert compiled.peak == pytest.approx(compiled.table.max())
    assert compiled.applied.gain == 1.0
    assert compiled.applied.bias_n == 0.5 * LAW.gain_n
