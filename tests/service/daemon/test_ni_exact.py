"""What is rendered is what an NI device plays, sample for sample, while scenes come and go."""

import numpy as np
import pytest
from tests.hardware.nidaq.bench import wiring

from frictus.textures import Component, Region, Scene, Spectrum

from .ni_bench import BLOCK, RATE_HZ, running

SCENE_S = 0.7


def texture(rng: np.random.Generator) -> Scene:
    component = Component(
        amplitude_n=float(rng.uniform(0.02, 0.08)), cycles_per_mm=float(rng.uniform(0.5, 5.0))
    )
    return Scene(regions=[Region(texture=Spectrum(components=[component]))])


@pytest.mark.parametrize("seconds", [3.0, pytest.param(60.0, marks=pytest.mark.campaign)])
def test_what_is_rendered_is_what_is_played(rng: np.random.Generator, seconds: float) -> None:
    with running() as bench:
        lead = bench.backend.info.lead_samples
        bench.arm()
        began, rendered = bench.device.now, []
        for _ in range(round(seconds / SCENE_S)):
            bench.play(texture(rng))
            for _ in range(round(SCENE_S * RATE_HZ) // BLOCK):
                (turn,) = bench.turn(1)
                rendered.append(turn.step.rendered.voltage_v.copy())  # valid until the next
        played_v = bench.device.played_v[began + lead :]
    rendered_v = np.concatenate(rendered)
    assert rendered_v.size >= (seconds - SCENE_S) * RATE_HZ
    assert np.mean(np.abs(rendered_v) > 1.0) > 0.3, "hardly anything was rendered"
    gain = wiring().amplifier_gain
    np.testing.assert_array_equal(played_v, rendered_v[: played_v.size] / gain)
    assert bench.loop.tally.underruns == bench.loop.tally.overruns == 0
