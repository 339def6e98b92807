"""Of free strokes over a texture, `frictus discover` tells what is there, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from tests.campaigns.live_model import plan_of, texture

from frictus.aligned import AlignedSamples
from frictus_laboratory.live_model.closed_loop import ClosedLoop
from frictus_laboratory.live_model.discovered import discovered
from frictus_laboratory.live_model.disturbances import WithEffect
from frictus_laboratory.live_model.laws import model_of
from frictus_laboratory.live_model.session_plan import motion_of
from frictus_service.discovery.document import OneRecording

pytestmark = pytest.mark.long

DELAY_S = 60e-6


def found(name: str, delay_s: float, rng: np.random.Generator) -> OneRecording:
    """Return what is ranked of half a minute, with a delay of the force channel or without."""
    plan = plan_of("known/paper/1/0", int(rng.integers(2**31)))
    plan = replace(
        plan, texture=texture(name), seconds=40.0, policy="observe", first=model_of(plan.person)
    )
    if delay_s:
        hidden = WithEffect("channel_delay", {"delay_s": delay_s})
        plan = replace(plan, disturbance=hidden)
    kept: list[AlignedSamples] = []
    loop = ClosedLoop(plan, motion_of(plan), kept.append)
    assert list(loop)
    ranked = discovered(kept, plan.first, loop.screen.peak_v)
    assert ranked is not None
    return ranked


@pytest.mark.parametrize("name", ["paper", "grating"])
def test_where_the_model_is_right_nothing_explains_the_recording(
    name: str, rng: np.random.Generator
) -> None:
    """Speeds and frequencies change together within a window, and lines leave their bands."""
    ranked = found(name, 0.0, rng)
    assert not ranked.beyond_threshold, ranked.models[0]


@pytest.mark.timeout(400)  # 75 s of a slow core
@pytest.mark.parametrize(("name", "within"), [("paper", 0.02), ("grating", 0.1)])
def test_a_delay_is_named_and_measured(
    name: str, within: float, rng: np.random.Generator
) -> None:
    """Of one line the cutoff of each fold is hardly known, and the delay beside it."""
    ranked = found(name, DELAY_S, rng)
    assert ranked.beyond_threshold
    first = ranked.models[0]
    assert first.causes == ("channel_delay",)
    estimate = first.parameters["channel_delay"]["delay_s"]
    assert estimate.value == pytest.approx(DELAY_S, rel=within)
    assert estimate.ci95 is not None
    half = (estimate.ci95[1] - estimate.ci95[0]) / 2.0
    assert abs(estimate.value - DELAY_S) < 2.0 * half
