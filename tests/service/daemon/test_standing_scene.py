"""The standing scene is the one that was answered, whatever follows within the same block."""

from collections.abc import Callable
from typing import Any

import pytest

from frictus.messages import Excitation, ExciteRequest, OpenStreamRequest, SceneRequest
from frictus.textures import Scene
from frictus_hardware.physics.screen import Screen
from frictus_service.daemon.safety import Stop
from frictus_service.daemon.scene_controller import SceneController

OWNER = {"client": "ann", "utc_ns": 1}
Over = Callable[[SceneController], object]


def stream(stage: SceneController) -> None:
    stage.open_stream(OpenStreamRequest(**OWNER, peak_n=0.05))


def excitation(stage: SceneController) -> None:
    stage.excite(ExciteRequest(**OWNER, excitation=Excitation(bias=0.5)))


@pytest.fixture
def bench(make_bench: Any) -> Any:
    return make_bench()


@pytest.fixture
def stage(bench: Any) -> SceneController:
    stage = SceneController(
        Screen(), bench.rate_hz, bench.interlock, bench.orders, lambda: bench.now_s
    )
    bench.turn(0.01)
    bench.arm()
    bench.turn(0.05)
    return stage


@pytest.mark.parametrize("over", [stream, excitation])
@pytest.mark.parametrize("played_s", [0.0, 0.1])
def test_a_scene_outlasts_what_is_played_over_it_at_once(
    bench: Any, stage: SceneController, texture: Scene, over: Over, played_s: float
) -> None:
    stage.set_scene(SceneRequest(**OWNER, scene=texture))
    over(stage)
    if played_s:
        bench.turn(played_s)
        assert bench.loop.rendering.chain.renderer.scene.source != "scene"
    bench.feed(Stop("ann"))
    bench.turn(0.1)
    bench.arm()
    bench.turn(0.1)
    assert (
        bench.loop.rendering.chain.renderer.scene
        is stage.compiled_for(bench.orders.model.in_force.inverse).compiled
    )
    assert stage.scene.scene == texture


def test_a_scene_ends_the_update_that_waits(
    bench: Any, stage: SceneController, texture: Scene
) -> None:
    stream(stage)
    stage.set_scene(SceneRequest(**OWNER, scene=texture))
    bench.turn(0.1)
    assert bench.loop.rendering.chain.renderer.scene.source == "scene"
