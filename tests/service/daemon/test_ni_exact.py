"""What is rendered is what an NI device plays, sample for sample, while scenes come and go."""

import numpy as np
import pytest
from tests.hardware.nidaq.bench import wiring

from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange

from .ni_bench import BLOCK, RATE_HZ, running

SCENE_S = 0.7


def texture(rng: np.random.Generator) -> Scene:
    component = Component(
        amplitude_n=float(rng.uniform(0.02, 0.08)), cycles_per_mm=float(rng.uniform(0.5, 5.0))
    )
    return Scene(regions=[Region(texture=Spectrum(components=[component]))])


@pytest.mark.parametrize("seconds", [3.0, pytest.param(60.0, marks=pytest.mark.campaign)])
def test_what_is_rendered_is_what_is_played(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch, seconds: float
) -> None:
    with running() as bench:
        lead = bench.backend.info.lead_samples
        bench.arm()
        began, rendered = bench.device.now, list[FloatArray]()
        exchange = bench.backend.exchange

        def noted(drive_v: FloatArray) -> Exchange:
            rendered.append(drive_v.copy())  # the renderer's own, valid until the next
            return exchange(drive_v)

        monkeypatch.setattr(bench.backend, "exchange", noted)
        for _ in range(round(seconds / SCENE_S)):
            bench.play(texture(rng))
            for _ in range(round(SCENE_S * RATE_HZ) // BLOCK):
                bench.turn(1)
        played_v = bench.device.played_v[began + lead :]
    rendered_v = np.concatenate(rendered)
    assert rendered_v.size >= (seconds - SCENE_S) * RATE_HZ
    assert np.mean(np.abs(rendered_v) > 1.0) > 0.3, "hardly anything was rendered"
    gain = wiring().amplifier_gain
    np.testing.assert_array_equal(played_v, rendered_v[: played_v.size] / gain)
    assert bench.loop.tally.underruns == bench.loop.tally.overruns == 0
