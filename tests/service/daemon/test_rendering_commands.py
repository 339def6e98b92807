"""Scenes and models by command: replaced where they match, compiled once, told as they are."""

from typing import Any

import pytest

from frictus_service.daemon.inboxes import ModelSlot
from frictus_service.daemon.safety import OutputQuiet, Safety
from frictus_service.synthesis.compensability import placeholder_model

from .desk import SCENE, TEXTURE, Desk, TakenAtTheLastMoment


def test_scene_is_replaced_only_where_it_matches(desk: Desk) -> None:
    seen = desk.stage.scene.etag
    assert desk.call("scene", scene=SCENE, if_match=seen).ok
    reply = desk.call("scene", scene={}, if_match=seen)
    assert reply.code == "conflict"
    assert desk.stage.scene.etag in reply.message


def test_a_scene_that_stands_is_not_compiled_again(desk: Desk) -> None:
    reply = desk.call("scene", scene=SCENE)
    compiled = desk.orders.scene[-1].scene
    ticket = desk.streaming()
    assert desk.send("texture", desk.frame(ticket)).ok
    assert desk.call("scene", scene=SCENE).etag == reply.etag
    assert desk.orders.scene[-1].scene is compiled
    assert not desk.stage.stream_open
    assert desk.call("scene", scene={"regions": []}).etag != reply.etag


def test_scenes_that_alternate_are_compiled_once(desk: Desk) -> None:
    compiled: dict[str | None, Any] = {}
    for name in ("a", "b", "a", "b"):
        reply = desk.call("scene", scene={**SCENE, "name": name})
        assert desk.stage.scene.scene.name == name
        rendered = desk.orders.scene[-1].scene
        assert compiled.setdefault(reply.etag, rendered) is rendered
    assert len(compiled) == 2
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["base"]["gain_n"] = 0.1  # less than the scene needs
    assert desk.call("model", model=model).ok
    reply = desk.call("scene", scene={**SCENE, "name": "a"})
    assert desk.orders.scene[-1].scene is not compiled[reply.etag]
    assert reply.applied is not None
    assert reply.applied.scaled


def test_model_changes_only_while_disarmed_and_matching(desk: Desk) -> None:
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["base"]["gain_n"] = 0.5
    desk.call("arm")
    assert desk.call("model", model=model).code == "conflict"
    desk.call("disarm")
    desk.interlock.feed(OutputQuiet(), desk.now_s)
    assert desk.call("model", model=model, if_match="else").code == "conflict"
    reply = desk.call("model", model=model, if_match=desk.models.model.etag)
    assert reply.ok
    assert reply.etag == desk.models.model.etag
    assert desk.orders.model.in_force.inverse.law.gain_n == 0.5


@pytest.mark.parametrize(("slot", "ok"), [(TakenAtTheLastMoment, True), (ModelSlot, False)])
def test_a_model_is_in_force_if_and_only_if_the_reply_says_so(
    slot: type[ModelSlot], ok: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("frictus_service.daemon.model_controller.MODEL_CHANGE_S", 0.0)
    desk = Desk(slot=slot)
    before = desk.models.model.etag
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["base"]["gain_n"] = 0.5
    reply = desk.call("model", model=model)
    assert reply.ok == ok
    assert desk.orders.model.take(Safety(), energised=False) is None, (
        "nothing is left that could be taken later"
    )
    in_force = desk.orders.model.in_force
    assert in_force.state.etag == desk.models.model.etag
    assert (in_force.inverse.law.gain_n == 0.5) == ok
    if ok:
        assert reply.etag == desk.models.model.etag
    else:
        assert reply.code == "conflict"
        assert desk.models.model.etag == before


def test_mobility_model_cannot_be_rendered(desk: Desk) -> None:
    model = {
        "response": "mobility",
        "base": {
            "law": "mass_spring_damper",
            "mass_kg": 0.0015,
            "damping_n_s_m": 1.3,
            "stiffness_n_m": 444.0,
        },
    }
    reply = desk.call("model", model=model)
    assert reply.code == "not_feasible"
    assert "friction" in reply.message


def test_effects_that_are_not_rendered_are_named_with_the_reason(desk: Desk) -> None:
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["effects"] = [
        {"id": "channel_delay", "parameters": {"delay_s": 1e-4}},
        {"id": "from_a_newer_version", "parameters": {"size": 1.0}},
        {"id": "charge_leakage", "parameters": {"corner_hz": 2.0}},
        {"id": "direction_asymmetry", "parameters": {"share": 0.1}},
    ]
    said = desk.call("model", model=model).message
    not_rendered, limited = said.split("rendered within limits")
    assert "channel_delay, because" in not_rendered
    assert "from_a_newer_version, because this version does not know it" in not_rendered
    assert "charge_leakage: " in limited
    assert "direction_asymmetry" not in said
    told = desk.models.model.not_rendered
    assert set(told) == {"channel_delay", "from_a_newer_version"}


@pytest.mark.parametrize(
    ("drive_vpp", "remarked"),
    [
        ((150.0, 150.0), ""),
        ((60.0, 148.0), ""),
        ((200.0, 200.0), "200 V"),
        ((50.0, 100.0), "50 to 100 V"),
    ],
)
def test_a_model_of_another_voltage_is_remarked_on(
    desk: Desk, drive_vpp: tuple[float, float], remarked: str
) -> None:
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["validity"]["drive_vpp"] = drive_vpp
    said = desk.call("model", model=model).message
    assert ("full drive is 150 V" in said) == bool(remarked)
    assert remarked in said


def test_a_model_with_an_effect_out_of_its_range_is_refused(desk: Desk) -> None:
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    model["effects"] = [{"id": "direction_asymmetry", "parameters": {"share": 3.0}}]
    reply = desk.call("model", model=model)
    assert reply.code == "not_feasible"
    assert "share" in reply.message
    assert desk.models.model.model.effects == []


def test_scenes_are_compiled_for_where_the_gain_is_least(desk: Desk) -> None:
    model = placeholder_model().model_dump(mode="json", by_alias=True)
    strong = {"regions": [{"texture": TEXTURE, "gain": 100.0}]}
    before = desk.call("scene", scene=strong).applied
    model["effects"] = [{"id": "direction_asymmetry", "parameters": {"share": 0.25}}]
    after = desk.call("model", model=model).applied
    assert before is not None
    assert after is not None
    assert after.gain == pytest.approx(0.75 * before.gain)
