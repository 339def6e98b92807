"""Compensation modes of a rig: who may choose one, how long it holds, and what is felt."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from frictus.errors import RefusedError
from frictus.messages import CompensationRequest
from frictus.model import BY_MODEL, Compensation, CompensationMode
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.physics.friction import motion_fade
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.command_validation import SHORT_BYTES
from frictus_service.daemon.inboxes import CompensationUpdate
from frictus_service.daemon.safety import (
    Arm,
    ClientVanished,
    Disarm,
    Event,
    FaultRaised,
    OutputQuiet,
    Stop,
)
from frictus_service.daemon.scene_controller import SceneController
from frictus_service.fidelity.path import exact_friction
from frictus_service.fidelity.preview import JND_DB, band_power, error_db, rms_db, windows
from frictus_service.synthesis.components import components_of

from .desk import SCENE, Desk

NONE = {"mode": "none"}
FIXED = {"mode": "fixed", "speed_mm_s": 60.0}
ENDS: dict[str, Event] = {
    "disarmed": Disarm("ann"),
    "stopped": Stop("ben"),
    "vanished": ClientVanished("ann"),
    "tripped": FaultRaised("safety", "monitor off"),
}


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_the_holder_chooses_and_is_told_what_is_in_force(desk: Desk) -> None:
    assert desk.stage.compensation == BY_MODEL
    desk.call("arm")
    for asked in (NONE, FIXED, {"mode": "model"}):
        reply = desk.call("compensation", compensation=asked)
        assert reply.ok
        assert reply.compensation == Compensation.model_validate(asked)
        assert desk.stage.compensation == reply.compensation
    assert desk.commands.refused == 0


def test_a_scene_leaves_the_mode_as_it_is(desk: Desk) -> None:
    desk.call("arm")
    desk.call("compensation", compensation=NONE)
    assert desk.call("scene", scene=SCENE).ok
    assert desk.stage.compensation.mode == "none"
    desk.call("arm")  # anew, without a pause
    assert desk.stage.compensation.mode == "none"


def test_while_disarmed_there_is_nothing_to_choose(desk: Desk) -> None:
    reply = desk.call("compensation", compensation=NONE)
    assert reply.code == "not_armed"
    assert not desk.orders.compensation


def test_others_are_refused_and_guests_are_not(desk: Desk) -> None:
    desk.call("arm", share_with=["cy"])
    reply = desk.call("compensation", "ben", compensation=NONE)
    assert reply.code == "not_owner"
    assert "'ann' holds the rig" in reply.message
    assert desk.stage.compensation == BY_MODEL
    assert desk.call("compensation", "cy.rest", compensation=NONE).ok


@pytest.mark.parametrize("end", ENDS.values(), ids=ENDS)
def test_the_next_holder_finds_the_model(desk: Desk, end: Event) -> None:
    desk.call("arm")
    desk.call("compensation", compensation=NONE)
    desk.interlock.feed(end, desk.now_s)
    assert desk.stage.compensation == BY_MODEL
    desk.interlock.feed(OutputQuiet(), desk.now_s)
    if not isinstance(end, FaultRaised):
        desk.call("arm", "ben")
        assert desk.stage.compensation == BY_MODEL


def test_a_lease_that_runs_out_ends_it(desk: Desk) -> None:
    desk.call("arm", lease_ms=500)
    desk.call("compensation", compensation=FIXED)
    desk.now_s += 0.6
    desk.interlock.tick(desk.now_s)
    assert desk.stage.compensation == BY_MODEL


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({}, "mode"),
        ({"mode": "off"}, "mode"),
        ({"mode": "fixed"}, "give it"),
        ({"mode": "none", "speed_mm_s": 60.0}, "leave it out"),
        ({"mode": "model", "speed_mm_s": 60.0}, "leave it out"),
        *(
            ({"mode": "fixed", "speed_mm_s": speed}, "speed_mm_s")
            for speed in (0.0, -60.0, 1e4, 1e308, "fast", [60.0])
        ),
    ],
    ids=str,
)
def test_what_is_no_mode_is_refused(desk: Desk, asked: dict[str, Any], said: str) -> None:
    desk.call("arm")
    reply = desk.call("compensation", compensation=asked)
    assert reply.code == "bad_request"
    assert said in reply.message
    assert desk.stage.compensation == BY_MODEL


@pytest.mark.parametrize("number", [b"NaN", b"Infinity", b"1e999", b"9" * 600])
def test_what_is_no_number_is_refused(desk: Desk, number: bytes) -> None:
    desk.call("arm")
    head = b'{"client":"ann","utc_ns":%d,"compensation":' % desk.utc_ns
    reply = desk.send("compensation", head + b'{"mode":"fixed","speed_mm_s":' + number + b"}}")
    assert reply.code == "bad_request"


def test_long_payloads_are_refused_unread(desk: Desk) -> None:
    desk.call("arm")
    assert desk.send("compensation", b"{" * (SHORT_BYTES + 1)).code == "too_large"


@pytest.mark.parametrize("speed", [1.0, 19.0, 101.0, 1_000.0])
def test_a_speed_for_which_the_model_does_not_hold_is_refused(desk: Desk, speed: float) -> None:
    desk.call("arm")
    reply = desk.call("compensation", compensation={"mode": "fixed", "speed_mm_s": speed})
    assert reply.code == "not_feasible"
    assert "20 to 100 mm/s" in reply.message
    assert desk.stage.compensation == BY_MODEL


TONES_HZ = (100.0, 200.0, 400.0, 630.0, 800.0, 1_000.0)
TEXTURE = Spectrum(components=[Component(amplitude_n=0.02, hz=f) for f in TONES_HZ])


class Driven:
    """A loop that plays tones under a slow finger, and what commands it."""

    def __init__(self, bench: Any) -> None:
        self.bench = bench
        self.stage = SceneController(
            bench.rig.config.screen,
            bench.rate_hz,
            bench.interlock,
            bench.orders,
            lambda: bench.now_s,
        )
        bench.play(Scene(regions=[Region(texture=TEXTURE)]))
        bench.turn(0.2)
        bench.arm()
        bench.turn(0.5)

    def choose(self, mode: CompensationMode, speed_mm_s: float | None = None) -> None:
        asked = Compensation(mode=mode, speed_mm_s=speed_mm_s)
        request = CompensationRequest(client="ann", utc_ns=0, compensation=asked)
        assert self.stage.compensate(request).compensation == asked

    def error_db(self) -> float:
        """How far what is felt during the next 1.5 s is from the target, rms over the bands."""
        self.bench.turn(0.1)  # what was queued before is played out
        turns = self.bench.turn(1.5)
        truths = [turn.exchange.truth for turn in turns]
        felt = np.concatenate([truth.friction_n for truth in truths])
        velocity = np.concatenate([truth.velocity_mm_s for truth in truths])
        position = np.concatenate([truth.position_mm for truth in truths])
        first = turns[0].exchange.first_sample
        rate = self.bench.rate_hz
        gain = self.bench.loop.rendering.chain.renderer.scene.applied.gain
        wanted = gain * exact_friction(components_of(TEXTURE), position, first, rate)
        wanted *= motion_fade(np.hypot(*velocity.T))
        steady = windows(felt.size, 8_192)
        target, found = (band_power(part, rate, steady) for part in (wanted, felt))
        return rms_db(error_db(found, target))


MakeDriven = Callable[[], Driven]


@pytest.fixture
def make_driven(make_bench: Any) -> MakeDriven:
    return lambda: Driven(make_bench(finger=SteadyStrokes(speed_mm_s=25.0)))


def test_compensation_is_what_keeps_the_felt_level_on_target(make_driven: MakeDriven) -> None:
    """In band by the model, out of it without or for another speed, and in band again."""
    driven = make_driven()
    assert driven.error_db() < JND_DB / 2.0
    driven.choose("none")
    assert driven.error_db() > 2.0 * JND_DB
    driven.choose("fixed", 100.0)
    assert driven.error_db() > JND_DB
    driven.choose("fixed", 25.0)
    assert driven.error_db() < JND_DB / 2.0
    driven.choose("none")
    assert driven.error_db() > 2.0 * JND_DB
    driven.choose("model")
    assert driven.error_db() < JND_DB / 2.0


def test_switching_while_it_plays_neither_trips_nor_clips(make_driven: MakeDriven) -> None:
    driven = make_driven()
    modes: tuple[CompensationMode, ...] = ("none", "model", "none", "model")
    for mode in modes:
        driven.choose(mode)
        driven.bench.turn(0.02)
    assert driven.bench.interlock.state.state == "armed"
    assert driven.bench.loop.tally.clipped_samples == 0


def rendered_mode(driven: Driven) -> str:
    """What the loop renders with, by what it inverts."""
    inverse = driven.bench.loop.rendering.chain.renderer.inverse
    return "model" if inverse is driven.bench.orders.model.in_force.inverse else "another"


@pytest.mark.parametrize("end", ENDS.values(), ids=ENDS)
def test_the_loop_is_back_at_the_model_when_the_arming_ends(
    make_driven: MakeDriven, end: Event
) -> None:
    driven = make_driven()
    driven.choose("none")
    driven.bench.turn(0.1)
    assert rendered_mode(driven) == "another"
    driven.bench.feed(end)
    driven.bench.turn(0.2)
    assert rendered_mode(driven) == "model"


def test_what_was_chosen_before_the_device_is_armed_holds_and_ends(
    make_driven: MakeDriven,
) -> None:
    driven = make_driven()
    bench = driven.bench
    bench.feed(Disarm("ann"))
    bench.turn(0.005)  # its last ramp still plays
    bench.feed(Arm("ann", 10.0))
    driven.choose("none")
    bench.turn(0.005)
    assert rendered_mode(driven) == "another"
    bench.turn(0.3)
    assert rendered_mode(driven) == "another"
    bench.feed(Disarm("ann"))
    bench.turn(0.005)
    bench.feed(Arm("ann", 10.0))
    driven.choose("none")
    bench.turn(0.005)
    bench.feed(Disarm("ann"))
    bench.turn(0.005)
    assert rendered_mode(driven) == "model", "the device was never armed for it"


def test_what_comes_after_its_arming_is_not_taken_up(make_driven: MakeDriven) -> None:
    driven = make_driven()
    bench = driven.bench
    driven.choose("none")
    (late,) = bench.orders.compensation
    bench.orders.compensation.clear()
    bench.feed(Disarm("ann"))
    bench.turn(0.2)
    bench.arm()
    bench.orders.compensation.append(CompensationUpdate(late.inverse, late.arming))
    bench.turn(0.2)
    assert rendered_mode(driven) == "model"
    assert driven.stage.compensation == BY_MODEL


def test_a_lease_that_ends_while_it_is_decided_chooses_nothing(
    make_driven: MakeDriven, monkeypatch: pytest.MonkeyPatch
) -> None:
    driven = make_driven()

    def slow(*_: object) -> Any:
        driven.bench.feed(Disarm("ann"))
        return driven.bench.orders.model.in_force.inverse

    monkeypatch.setattr("frictus_service.daemon.scene_controller.inverse_in_mode", slow)
    with pytest.raises(RefusedError) as refused:
        driven.choose("none")
    assert refused.value.code == "not_armed"
    assert not driven.bench.orders.compensation
