"""The model that the loop renders by: when it changes, and what it says of it."""

import threading
from typing import Any

import numpy as np
import pytest

from frictus.errors import RefusedError
from frictus.messages import ModelRequest
from frictus.model import Effect, Model
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen, drive_fraction_of
from frictus_service.daemon.inboxes import ModelUpdate
from frictus_service.daemon.model_controller import ModelController, rendered_model
from frictus_service.daemon.safety import Stop
from frictus_service.daemon.scene_controller import SceneController
from frictus_service.json_text import etag_of
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.synthesis.compensator import Inverter
from frictus_service.synthesis.scene import compile_scene

from .desk import scaled
from .driven import driven

STRONGER = scaled(placeholder_model(), 1.3)


def ordered(bench: Any, model: Model, texture: Scene) -> ModelUpdate:
    """Return an order of a model that the loop was left."""
    rendered = rendered_model(model, Screen())
    scene = compile_scene(texture, rendered.inverse, Screen(), bench.rate_hz)
    bench.orders.model.offer(order := ModelUpdate(rendered, scene))
    return order


def test_law_changes_only_without_output(make_bench: Any, texture: Scene) -> None:
    bench = driven(make_bench(), texture)
    order = ordered(bench, STRONGER, texture)
    before = bench.orders.model.in_force
    bench.turn(0.1)
    assert not order.done.is_set()
    assert bench.orders.model.in_force is before
    bench.feed(Stop("ben"))
    bench.turn(0.2)
    assert order.done.is_set()
    assert bench.orders.model.in_force is order.model


def test_a_scene_compiled_for_the_former_model_gives_way(
    make_bench: Any, texture: Scene
) -> None:
    bench = make_bench()
    bench.turn(0.2)
    bench.play(Scene())
    order = ordered(bench, STRONGER, texture)
    bench.turn(0.1)
    assert bench.loop.rendering.chain.renderer.scene is order.scene


def test_reply_state_and_loop_agree_on_the_model_though_the_loop_stands_still(
    make_bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make_bench()
    stage = SceneController(
        Screen(), bench.rate_hz, bench.interlock, bench.orders, lambda: bench.now_s
    )
    models = ModelController(
        Screen(), bench.interlock, bench.orders, stage, lambda: bench.now_s
    )
    bench.turn(0.1)
    stands, goes_on = threading.Event(), threading.Event()

    class Slow(Inverter):
        def __init__(self, *arguments: Any) -> None:
            stands.set()
            assert goes_on.wait(30.0)
            super().__init__(*arguments)

    def turn_until_it_stands() -> None:
        while not stands.is_set():
            bench.loop.turn()

    monkeypatch.setattr("frictus_service.synthesis.renderer.Inverter", Slow)
    loop = threading.Thread(target=turn_until_it_stands)
    loop.start()
    try:
        request = ModelRequest(client="ann", utc_ns=0, model=STRONGER)
        try:
            etag = models.set_model(request).etag
        except RefusedError:
            etag = etag_of(placeholder_model())
    finally:
        goes_on.set()
        loop.join()
    in_force = bench.orders.model.in_force
    assert etag == models.model.etag == in_force.state.etag
    assert bench.loop.rendering.chain.renderer.inverse is in_force.inverse


def test_a_drift_counts_from_when_the_law_came_and_through_armings(
    make_bench: Any,
) -> None:
    hum = Spectrum(components=[Component(amplitude_n=0.05, hz=100.0)])
    texture = Scene(regions=[Region(texture=hum)])
    bench = make_bench()
    bench.turn(1.0)
    drift = Effect(id="gain_drift", parameters={"per_minute": 1.0})
    drifting = placeholder_model().model_copy(update={"effects": [drift]})
    scene = ordered(bench, drifting, texture).scene
    bench.turn(0.005)
    came_s = bench.now_s
    levels = []
    for _ in range(2):
        bench.turn(1.5)
        bench.arm()
        bench.turn(0.5)
        turns = bench.turn(0.5)
        voltage = np.concatenate([turn.exchange.voltage_v for turn in turns])
        since_min = (bench.now_s - 0.25 - came_s) / 60.0
        levels.append(drive_fraction_of(Screen(), voltage).mean() * np.exp(since_min))
        bench.feed(Stop("ann"))
        bench.turn(0.2)
    assert levels[1] == pytest.approx(levels[0], rel=2e-3)
    assert levels[0] * FrictionLaw().gain_n == pytest.approx(scene.applied.bias_n, rel=5e-3)
