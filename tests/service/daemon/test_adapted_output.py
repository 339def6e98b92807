"""The output while the model follows the finger: it fades, and goes on."""

from typing import Any

import numpy as np
import pytest

from frictus.model import Model
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.daemon.inboxes import (
    CompensationUpdate,
    ModelUpdate,
    SceneUpdate,
)
from frictus_service.daemon.model_controller import rendered_model
from frictus_service.daemon.safety import Arm, Disarm, Stop
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.synthesis.compensation import Inverse
from frictus_service.synthesis.renderer import FADE_S
from frictus_service.synthesis.scene import StreamBudget, compile_scene

from .desk import scaled


def stream_with(inverse: Inverse) -> SceneUpdate:
    """A stream without updates yet, of the first arming."""
    quiet = StreamBudget.open(0.1, inverse).quiet
    return SceneUpdate(quiet, afterwards=quiet, arming=1)


class Adapted:
    """A loop that plays tones under a slow finger, and models that come meanwhile."""

    def __init__(self, bench: Any) -> None:
        self.bench = bench
        tones = [Component(amplitude_n=0.02, hz=f) for f in (100.0, 200.0, 400.0)]
        self.scene = Scene(regions=[Region(texture=Spectrum(components=tones))])
        bench.play(self.scene)
        bench.turn(0.2)
        bench.arm()
        bench.turn(0.5)

    def offer(self, model: Model, **fields: Any) -> ModelUpdate:
        rendered = rendered_model(model, Screen())
        scene = compile_scene(self.scene, rendered.inverse, Screen(), self.bench.rate_hz)
        order = ModelUpdate(rendered, scene, fades=True, **fields)
        self.bench.orders.model.offer(order)
        return order


@pytest.fixture
def adapted(make_bench: Any) -> Adapted:
    return Adapted(make_bench(finger=SteadyStrokes(speed_mm_s=25.0)))


def test_the_output_fades_to_another_model_and_goes_on(adapted: Adapted) -> None:
    bench = adapted.bench
    order = adapted.offer(scaled(placeholder_model(), 1.5, 0.7))
    turns = bench.turn(0.1)
    assert order.done.is_set()
    assert bench.orders.model.in_force is order.model
    drive = np.concatenate([turn.drive for turn in turns])
    own = float(np.abs(np.diff(drive[-1_000:])).max())
    slope = 1.5 / (FADE_S * bench.rate_hz)
    before, after = (np.ptp(part) for part in (drive[:100], drive[-1_000:]))
    assert np.abs(np.diff(drive)).max() <= 1.3 * own + slope * (before + after + 0.5)
    assert bench.interlock.state.state == "armed"
    assert bench.loop.tally.clipped_samples == 0
    assert bench.loop.rendering.chain.renderer.scene is order.scene


def test_an_adapted_model_stays_when_the_arming_ends(adapted: Adapted) -> None:
    bench = adapted.bench
    order = adapted.offer(scaled(placeholder_model(), 1.5))
    bench.turn(0.1)
    bench.feed(Stop("ben"))
    bench.turn(0.3)
    renderer = bench.loop.rendering.chain.renderer
    assert (renderer.inverse, renderer.scene) == (order.model.inverse, order.scene)
    assert not np.any(bench.turns[-1].exchange.voltage_v)


def test_the_owner_who_keeps_the_model_keeps_it_from_what_was_under_way(
    adapted: Adapted,
) -> None:
    bench = adapted.bench
    before = bench.orders.model.in_force
    bench.feed(Arm("ann", 10.0, keep_model=True))  # anew, without a pause
    order = adapted.offer(scaled(placeholder_model(), 1.5))
    bench.turn(0.2)
    assert not order.done.is_set()
    assert bench.orders.model.in_force is before
    bench.feed(Disarm("ann"))
    bench.turn(0.01)
    assert order.done.is_set()


def test_a_stream_of_an_arming_that_is_over_is_not_taken_up(adapted: Adapted) -> None:
    bench = adapted.bench
    model = scaled(placeholder_model(), 1.5)
    inverse = rendered_model(model, Screen()).inverse
    quiet = stream_with(inverse)
    bench.feed(Disarm("ann"))
    order = adapted.offer(model, stream=quiet)
    bench.turn(0.2)
    assert order.done.is_set()
    assert bench.loop.rendering.chain.renderer.scene is order.scene


def test_a_stream_goes_on_under_the_adapted_model(adapted: Adapted) -> None:
    bench = adapted.bench
    model = scaled(placeholder_model(), 1.5)
    stream = stream_with(rendered_model(model, Screen()).inverse)
    order = adapted.offer(model, stream=stream)
    bench.turn(0.1)
    assert bench.loop.rendering.chain.renderer.scene is stream.scene
    bench.feed(Stop("ben"))
    bench.turn(0.2)
    assert bench.loop.rendering.chain.renderer.scene is order.scene


def test_a_mode_that_was_chosen_for_the_former_model_gives_way(adapted: Adapted) -> None:
    bench = adapted.bench
    former = bench.orders.model.in_force.inverse
    bench.orders.compensation.append(CompensationUpdate(former, 1))  # mode `model`
    bench.turn(0.005)
    order = adapted.offer(scaled(placeholder_model(), 1.5))
    bench.turn(0.1)
    assert bench.loop.rendering.chain.renderer.inverse is order.model.inverse
    bench.feed(Stop("ben"))
    bench.turn(0.2)
    assert bench.loop.rendering.chain.renderer.inverse is order.model.inverse


def test_friction_follows_the_new_model_without_a_jump(make_bench: Any) -> None:
    """The finger's own law halves its gain; the model follows, and the target is felt again."""
    law = FrictionLaw(0.3)
    bench = make_bench(
        finger=SteadyStrokes(speed_mm_s=25.0), participant={"gain_n": law.gain_n}
    )
    played = Adapted(bench)
    truth = scaled(placeholder_model(), law.gain_n / FrictionLaw().gain_n)
    order = played.offer(truth)
    felt = np.concatenate([turn.exchange.truth.friction_n for turn in bench.turn(0.3)])
    assert order.done.is_set()
    settled = np.abs(np.diff(felt[-2_000:])).max()
    slope = 1.5 / (FADE_S * bench.rate_hz)
    assert np.abs(np.diff(felt)).max() <= 1.5 * settled + slope * law.gain_n
    bias_n = order.scene.applied.bias_n
    assert felt[-4_000:].mean() == pytest.approx(bias_n, rel=0.05)
