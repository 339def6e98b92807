"""A model that follows the finger: who may, how far, what is felt, and how it is undone."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from tests.patience import PATIENT

import frictus
from frictus.errors import RefusedError
from frictus.messages import AdaptRequest
from frictus.model import Model
from frictus.textures import Scene
from frictus_hardware import SimulatedConfig
from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.command_validation import SHORT_BYTES
from frictus_service.config import ApiConfig, Config, RouterConfig, TrackerConfig
from frictus_service.daemon.inboxes import (
    ModelSlot,
    ModelUpdate,
)
from frictus_service.daemon.model_controller import rendered_model
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.daemon.safety import Disarm, FaultRaised, OutputQuiet, Safety
from frictus_service.processes import free_endpoint
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.synthesis.scene import compile_scene
from frictus_service.tracking.adaptation import ADAPT_EVERY_S, ADAPT_WITHIN, law_values

from .desk import SCENE, Desk, TakenAtTheLastMoment, scaled

TRACKER = "rig1.tracker"
EXCITATION = {"bias": 0.5, "tones": [{"hz": 100.0, "amplitude": 0.1}]}
FIXED = {"mode": "fixed", "speed_mm_s": 60.0}


class Tracked(Desk):
    """A desk under the policy `adapt`, and its tracker."""

    def __post_init__(self) -> None:
        super().__post_init__()
        assert self.call("adaptation", policy="adapt").ok

    def adapt(self, model: Model | None = None, **fields: Any) -> Any:
        model = model or scaled(self.models.model.model, 1.1)
        asked = {"if_match": self.models.model.etag, **fields}
        document = model.model_dump(mode="json", by_alias=True)
        return self.call("adapt", TRACKER, model=document, **asked)

    def wait(self, seconds: float = ADAPT_EVERY_S) -> None:
        self.now_s += seconds
        self.interlock.tick(self.now_s)

    def arm(self, client: str = "ann", **fields: Any) -> None:
        assert self.call("arm", client, lease_ms=10_000, **fields).ok

    def disarm(self) -> None:
        self.interlock.feed(Disarm(str(self.interlock.state.owner)), self.now_s)
        self.interlock.feed(OutputQuiet(), self.now_s)


@pytest.fixture
def desk() -> Tracked:
    return Tracked()


@pytest.mark.parametrize("armed", [False, True])
def test_a_tracker_adapts_the_model_and_it_is_said(desk: Tracked, armed: bool) -> None:
    if armed:
        desk.arm()
    before = desk.models.model
    reply = desk.adapt(scaled(before.model, 1.1, 0.8), reason="the finger\nis drier")
    assert reply.ok
    after = desk.models.model
    assert reply.etag == after.etag != before.etag
    assert (after.adapted_from, after.reason) == (before.etag, "the finger\nis drier")
    assert desk.orders.model.in_force.inverse.law.gain_n == after.model.base.gain_n  # type: ignore[union-attr]
    assert desk.models.adaptations == 1
    assert desk.said == [
        "the model follows the finger: gain 0.390 to 0.429 N, cutoff at 20 mm/s 662 to 530 Hz, "
        "at 100 mm/s 1767 to 1413 Hz (the finger is drier)"
    ]
    assert desk.stage.scene.applied.bias_n == reply.applied.bias_n
    assert desk.interlock.state.state == ("armed" if armed else "disarmed")


def refused_cases() -> dict[str, tuple[str, Callable[[Tracked], Any]]]:
    model = placeholder_model()
    base = model.base.model_dump()

    def law(**changes: float) -> Model:
        return Model.model_validate({"base": {**base, **changes}, "placeholder": True})

    def effect(desk: Tracked) -> Any:
        added = model.model_dump(mode="json", by_alias=True)
        added["effects"] = [{"id": "channel_delay", "parameters": {"delay_s": 1e-4}}]
        return desk.adapt(Model.model_validate(added))

    def observed(desk: Tracked) -> Any:
        desk.call("adaptation", policy="observe")
        return desk.adapt()

    def suggested(desk: Tracked) -> Any:
        desk.call("adaptation", policy="suggest")
        return desk.adapt()

    def soon(desk: Tracked) -> Any:
        assert desk.adapt().ok
        desk.wait(ADAPT_EVERY_S - 0.01)
        return desk.adapt()

    def soon_after_it_was_set(desk: Tracked) -> Any:
        document = scaled(model, 1.2).model_dump(mode="json", by_alias=True)
        assert desk.call("model", model=document).ok
        return desk.adapt()

    def excited(desk: Tracked) -> Any:
        desk.arm()
        assert desk.call("excite", excitation=EXCITATION).ok
        return desk.adapt()

    def compensated(desk: Tracked) -> Any:
        desk.arm()
        assert desk.call("compensation", compensation=FIXED).ok
        return desk.adapt()

    def kept(desk: Tracked) -> Any:
        desk.arm(keep_model=True)
        return desk.adapt()

    def tripped(desk: Tracked) -> Any:
        desk.interlock.feed(FaultRaised("safety", "monitor off"), desk.now_s)
        return desk.adapt()

    return {
        "policy observe": ("conflict", observed),
        "policy suggest": ("conflict", suggested),
        "another etag": ("conflict", lambda desk: desk.adapt(if_match="else")),
        "no etag": ("bad_request", lambda desk: desk.adapt(if_match=None)),
        "too soon": ("unavailable", soon),
        "too soon after it was set": ("unavailable", soon_after_it_was_set),
        "excitation": ("conflict", excited),
        "fixed speed": ("conflict", compensated),
        "kept": ("not_owner", kept),
        "tripped": ("tripped", tripped),
        "another effect": ("not_feasible", effect),
        "another delay": (
            "not_feasible",
            lambda desk: desk.adapt(model.model_copy(update={"skew_s": 1e-4})),
        ),
        "another hold": (
            "not_feasible",
            lambda desk: desk.adapt(model.model_copy(update={"hold_s": 1e-4})),
        ),
        "gain too high": ("not_feasible", lambda desk: desk.adapt(scaled(model, 4.01))),
        "gain too low": ("not_feasible", lambda desk: desk.adapt(scaled(model, 0.249))),
        "cutoff too high": ("not_feasible", lambda desk: desk.adapt(scaled(model, 1.0, 4.01))),
        "cutoff too low": ("not_feasible", lambda desk: desk.adapt(scaled(model, 1.0, 0.249))),
        "cutoff at one end": (
            "not_feasible",
            lambda desk: desk.adapt(law(slope_hz_per_mm_s=-3.0)),
        ),
        "reason too long": ("bad_request", lambda desk: desk.adapt(reason=501 * "x")),
    }


@pytest.mark.parametrize(("code", "ask"), refused_cases().values(), ids=refused_cases())
def test_what_is_no_adaptation_is_refused(
    desk: Tracked, code: str, ask: Callable[[Tracked], Any]
) -> None:
    reply = ask(desk)
    assert not reply.ok
    assert reply.code == code
    assert len(reply.message) > 20
    assert desk.commands.refused == 0  # counted by whoever answers, not here
    if desk.models.adaptations == 0:
        assert desk.models.model.adapted_from is None


def test_an_unknown_field_of_the_model_is_of_the_instrument(desk: Tracked) -> None:
    newer = desk.models.model.model.model_dump(mode="json", by_alias=True)
    newer["from_the_future"] = [1, 2]
    reply = desk.adapt(Model.model_validate(newer))
    assert reply.code == "not_feasible"
    assert "from_the_future" in reply.message


def test_what_tells_how_it_was_measured_may_differ(desk: Tracked) -> None:
    told = {
        "participant": "p7",
        "placeholder": False,
        "provenance": {"source": "live"},
        "covariance": {"parameters": ["gain_n"], "matrix": [[1e-4]]},
    }
    document = {**desk.models.model.model.model_dump(mode="json", by_alias=True), **told}
    assert desk.adapt(Model.model_validate(document)).ok
    assert desk.models.model.model.participant == "p7"


def test_the_bound_is_of_the_model_that_was_set_however_often_it_is_adapted(
    desk: Tracked, rng: np.random.Generator
) -> None:
    as_set = law_values(desk.models.model.model)
    assert as_set is not None
    for _ in range(40):
        gain, cutoff = np.exp(rng.normal(0.2, 0.5, 2))
        desk.adapt(scaled(desk.models.model.model, float(gain), float(cutoff)))
        found = law_values(desk.models.model.model)
        assert found is not None
        for name, value in found:
            assert abs(math.log(value / getattr(as_set, name))) <= math.log(ADAPT_WITHIN) + 1e-9
        desk.wait()
    assert 5 < desk.models.adaptations < 40


def test_a_model_that_is_set_begins_anew(desk: Tracked) -> None:
    assert desk.adapt().ok
    document = scaled(placeholder_model(), 2.0).model_dump(mode="json", by_alias=True)
    assert desk.call("model", model=document).ok
    assert desk.models.adaptations == 0
    assert desk.models.model.adapted_from is None
    desk.wait()
    assert desk.adapt(scaled(placeholder_model(), 7.9)).ok, "four times what was set"
    assert desk.call("adaptation", policy="adapt", undo=True).ok
    assert desk.models.model.model == Model.model_validate(document)


@pytest.mark.parametrize("armed", [False, True])
@pytest.mark.parametrize("policy", ["observe", "suggest", "adapt"])
def test_an_undo_puts_back_what_was_set(desk: Tracked, armed: bool, policy: str) -> None:
    as_set = desk.models.model
    if armed:
        desk.arm()
    for _ in range(2):
        assert desk.adapt().ok
        desk.wait()
    reply = desk.call("adaptation", "ben", policy=policy, undo=True)
    assert reply.ok
    assert (reply.adaptation, reply.etag) == (policy, as_set.etag)
    assert desk.models.model is as_set
    assert (desk.models.policy, desk.models.adaptations) == (policy, 0)
    assert "as ben asked" in desk.said[-1]
    assert "gain 0.472 to 0.390 N" in desk.said[-1]
    again = desk.call("adaptation", "ben", policy=policy, undo=True)
    assert again.ok
    assert len(desk.said) == 3, "nothing was left to undo"


@pytest.mark.parametrize(
    ("code", "begin"),
    [
        ("conflict", lambda desk: desk.call("excite", excitation=EXCITATION)),
        ("conflict", lambda desk: desk.call("compensation", compensation=FIXED)),
        ("not_owner", lambda desk: desk.call("arm", keep_model=True)),
    ],
    ids=["excitation", "fixed speed", "kept by another"],
)
def test_an_undo_that_is_refused_changes_nothing(
    desk: Tracked, code: str, begin: Callable[[Tracked], Any]
) -> None:
    assert desk.adapt().ok
    desk.arm()
    assert begin(desk).ok
    adapted = desk.models.model
    assert desk.call("adaptation", "ben", policy="observe", undo=True).code == code
    assert desk.models.model is adapted
    assert (desk.models.policy, desk.models.adaptations) == ("adapt", 1)
    assert desk.call("adaptation", "ben", policy="observe").ok, "the policy alone may change"


def test_who_keeps_the_model_may_put_it_back_and_it_ends_with_the_lease(desk: Tracked) -> None:
    assert desk.adapt().ok
    desk.arm(keep_model=True)
    assert desk.call("adaptation", "ann", policy="adapt", undo=True).ok
    assert desk.models.adaptations == 0
    desk.wait()
    assert desk.adapt().code == "not_owner"
    desk.disarm()
    assert desk.adapt().ok
    desk.arm("ben")
    desk.wait()
    assert desk.adapt().ok, "the next owner has not asked for it"


def test_a_policy_needs_no_lease_and_is_short(desk: Tracked) -> None:
    desk.arm()
    assert desk.call("adaptation", "ben", policy="suggest").adaptation == "suggest"
    assert desk.call("adaptation", "ben", policy="follow").code == "bad_request"
    assert desk.send("adaptation", b"{" * (SHORT_BYTES + 1)).code == "too_large"
    assert desk.models.policy == "suggest"


def test_a_stream_keeps_its_peak_and_is_bounded_anew(desk: Tracked) -> None:
    ticket = desk.streaming()
    frame = desk.frame(ticket)
    assert desk.send("texture", frame).ok
    before = desk.stage.scene
    taken: list[ModelUpdate] = []
    offer = desk.orders.model.offer
    desk.orders.model.offer = lambda order: (taken.append(order), offer(order))  # type: ignore[method-assign,func-returns-value,assignment]
    assert desk.adapt(scaled(desk.models.model.model, 2.0, 0.5)).ok
    after = desk.stage.scene
    assert after.etag == before.etag, "it is the same stream"
    assert after.applied.bias != before.applied.bias
    update = taken[0].stream
    assert update is not None
    assert update.scene.applied == after.applied
    assert update.afterwards is not None
    assert update.until_s == pytest.approx(desk.now_s + 0.2)
    assert desk.send("texture", desk.frame(ticket, 1)).ok
    assert desk.orders.scene[-1].scene.applied == after.applied
    wild = desk.frame(ticket, 2, friction_n=10.0 * np.sin(np.arange(64.0)).astype(np.float32))
    assert desk.send("texture", wild).code == "not_feasible", "the peak is as declared"


def test_the_standing_scene_is_compiled_for_the_adapted_model(desk: Tracked) -> None:
    assert desk.call("scene", scene=SCENE).ok
    etag = desk.stage.scene.etag
    reply = desk.adapt(scaled(desk.models.model.model, 0.5))
    assert desk.stage.scene.etag == etag
    alone = compile_scene(
        Scene.model_validate(SCENE), desk.orders.model.in_force.inverse, Screen(), 20_000.0
    )
    assert reply.applied == desk.stage.scene.applied == alone.applied


@pytest.mark.parametrize(("slot", "ok"), [(TakenAtTheLastMoment, True), (ModelSlot, False)])
@pytest.mark.parametrize("call", ["adapt", "undo"])
def test_a_model_is_adapted_if_and_only_if_the_reply_says_so(
    slot: type[ModelSlot], ok: bool, call: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("frictus_service.daemon.model_controller.MODEL_CHANGE_S", 0.0)
    desk = Tracked(slot=slot)
    if call == "undo":
        adapted = rendered_model(scaled(placeholder_model(), 1.3), Screen())
        desk.orders.model.offer(ModelUpdate(adapted, desk.orders.scene[0].scene))  # type: ignore[arg-type]
        desk.orders.model.take(Safety(), energised=False)
    before = desk.models.model.etag
    desk.arm()
    if call == "adapt":
        reply = desk.adapt()
    else:
        reply = desk.call("adaptation", policy="observe", undo=True)
    assert reply.ok == ok
    armed = desk.interlock.state
    assert desk.orders.model.take(armed, energised=True) is None, "nothing is left to take"
    assert (desk.models.model.etag != before) == ok
    if not ok:
        assert reply.code == "conflict"
        assert desk.models.policy == "adapt"


def test_the_slot_holds_an_adaptation_to_the_safety_state_of_the_moment() -> None:
    slot = ModelSlot(rendered_model(placeholder_model(), Screen()))
    other = rendered_model(scaled(placeholder_model(), 1.2), Screen())
    scene = compile_scene(Scene(), other.inverse, Screen(), 20_000.0)
    kept = Safety("armed", "ann", armings=1, keep_model=True)
    shared = Safety("armed", "ann", armings=1)
    for order, takes in [
        (ModelUpdate(other, scene), (False, False, True)),
        (ModelUpdate(other, scene, fades=True), (False, True, True)),
        (ModelUpdate(other, scene, fades=True, client="ben"), (False, True, True)),
        (ModelUpdate(other, scene, fades=True, client="ann"), (True, True, True)),
    ]:
        states = ((kept, True), (shared, True), (Safety(), False))
        for (safety, energised), taken in zip(states, takes, strict=True):
            slot.offer(order)
            assert (slot.take(safety, energised) is order) is taken
            assert slot.withdraw(order) is not taken


# What the loop makes of it


# On a real rig


@pytest.fixture(scope="module")
def endpoint() -> Iterator[tuple[str, list[str]]]:
    config = Config(
        backend=SimulatedConfig(finger=SteadyStrokes()),
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=0),
        tracker=TrackerConfig(policy="suggest"),
        limits=PATIENT,
    )
    said: list[str] = []
    with Supervisor(config, ("rig",), say=said.append) as supervisor:
        supervisor.wait_ready(100.0)
        yield config.router.endpoint, said


def test_policy_adaptation_and_undo_through_a_client(
    endpoint: tuple[str, list[str]],
) -> None:
    address, said = endpoint
    with (
        frictus.connect(address, "ann") as ann,
        frictus.connect(address, TRACKER) as tracker,
    ):
        rig, tracked = ann.rig("rig1", wait_s=60.0), tracker.rig("rig1")
        assert rig.status().adaptation == "suggest", "as it is configured"
        as_set = rig.model()
        finer = scaled(as_set.model, 1.1)
        with pytest.raises(RefusedError, match="policy of this rig is 'suggest'"):
            tracked.adapt(finer, as_set.etag)
        assert rig.set_adaptation("adapt") == "adapt"
        assert rig.status().adaptation == "adapt"
        assert tracked.status().adaptations == 0
        rig.set_scene(Scene.model_validate(SCENE))
        with rig.arm(lease_ms=10_000):
            etag = tracked.adapt(finer, as_set.etag, "gain 10 % higher")
            state = tracked.model()
            assert (state.etag, state.adapted_from) == (etag, as_set.etag)
            assert state.reason == "gain 10 % higher"
            status = tracked.status()
            assert (status.state, status.adaptations) == ("armed", 1)
            assert status.model_etag == etag
            with pytest.raises(RefusedError, match="read it again") as refused:
                tracked.adapt(finer, as_set.etag)
            assert refused.value.code == "conflict"
            assert rig.set_adaptation("observe", undo=True) == "observe"
            assert rig.model().etag == as_set.etag
            status = rig.status()
            assert (status.state, status.adaptations) == ("armed", 0)
            assert status.counters.clipped_samples == 0
        rig.set_adaptation("adapt")
        with rig.arm(lease_ms=10_000, keep_model=True):
            with pytest.raises(RefusedError, match="'ann' holds the rig and keeps") as refused:
                tracked.adapt(finer, as_set.etag)
            assert refused.value.code == "not_owner"
    assert any("the model follows the finger: gain 0.390 to 0.429 N" in line for line in said)
    assert any("as ann asked" in line for line in said)


def test_a_request_has_the_etag_that_it_was_made_from() -> None:
    with pytest.raises(ValueError, match="if_match"):
        AdaptRequest(client="a", utc_ns=0, model=placeholder_model())  # type: ignore[call-arg]
