"""Base models: the paper's, a constant cutoff, and one's own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.service.discovery.made import MOUNT

from frictus.model import Effect, Model
from frictus_hardware.errors import UnknownEffectError
from frictus_hardware.physics.effects import EFFECTS
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Probe, Simulator, predict
from frictus_service.discovery.problem.base_models import (
    MIDDLE_SPEED_MM_S,
    base_model,
    simulator_of,
)
from frictus_service.errors import BaseModelError, ServiceError

TONES_HZ = np.array([30.0, 300.0, 2000.0])


def at(speed_mm_s: float) -> Probe:
    one = np.ones(TONES_HZ.size)
    around = SlidingConditions(speed_mm_s * one, 0.4 * one, 35.0 * one, one, 0.0 * one)
    return Probe(TONES_HZ, 0.5 * one.astype(np.complex128), 0.5 * one, one / 8.0, around)


def test_the_papers_is_its_law() -> None:
    law = FrictionLaw()
    simulator = simulator_of(base_model("paper", "friction"), MOUNT)
    for speed in (1.0, 60.0, 200.0):
        cutoff_hz = law.cutoff_0_hz + law.slope_hz_per_mm_s * speed
        np.testing.assert_allclose(
            predict(simulator, at(speed), MOUNT).friction,
            law.gain_n / (1.0 + 1j * TONES_HZ / cutoff_hz),
        )


def test_a_constant_cutoff_agrees_in_the_middle() -> None:
    constant, paper = (
        simulator_of(base_model(name, "friction"), MOUNT)
        for name in ("constant-cutoff", "paper")
    )
    here = at(MIDDLE_SPEED_MM_S)
    middle = predict(paper, here, MOUNT).friction
    for speed in (20.0, MIDDLE_SPEED_MM_S, 100.0):
        np.testing.assert_allclose(predict(constant, at(speed), MOUNT).friction, middle)


def test_the_skins_is_mass_damping_and_stiffness() -> None:
    model = base_model("paper", "mobility")
    simulator = simulator_of(model, None)
    skin = simulator.mobility
    s = 2j * np.pi * TONES_HZ
    np.testing.assert_allclose(
        predict(simulator, at(60.0), None).mobility,
        s / (skin.mass_kg * s**2 + skin.damping_n_s_m * s + skin.stiffness_n_m),
    )
    assert simulator.response == "mobility"


def test_a_file_is_read_with_its_effects_and_its_skew(tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    size = {"exponent": 0.2}
    model = base_model("paper", "friction").model_copy(
        update={"effects": [Effect(id="force_dependent_gain", parameters=size)]}
    )
    path.write_text(model.model_dump_json(by_alias=True), "utf-8")
    read = base_model(str(path), "friction")
    assert read == model
    plain = simulator_of(base_model("paper", "friction"), MOUNT)
    with_effect = EFFECTS["force_dependent_gain"].extend(plain, size)
    assert simulator_of(read, MOUNT) == with_effect
    late = read.model_copy(update={"skew_s": 1e-5})
    assert simulator_of(late, MOUNT) == replace(with_effect, delay_s=1e-5)


@pytest.mark.parametrize(
    ("name", "response", "told"),
    [
        ("constant-cutoff", "mobility", "is a model of friction"),
        ("nowhere.json", "friction", "no base model 'nowhere.json'; accepted: paper,"),
        ("nowhere.json", "mobility", "no base model"),
    ],
)
def test_what_is_no_base_model(name: str, response: str, told: str) -> None:
    with pytest.raises(BaseModelError, match=told) as raised:
        base_model(name, response)  # type: ignore[arg-type]
    assert isinstance(raised.value, ServiceError)
    assert isinstance(raised.value, ValueError)


def test_a_file_that_is_none(tmp_path: Path) -> None:
    path = tmp_path / "bad.json"
    for text in ("", "[]", '{"schema": "model/2"}'):
        path.write_text(text, "utf-8")
        with pytest.raises(BaseModelError, match=r"is no model/1 document"):
            base_model(str(path), "friction")
    with pytest.raises(BaseModelError, match="is no model/1 document"):
        base_model(str(tmp_path), "friction")
    skin = base_model("paper", "mobility")
    path.write_text(skin.model_dump_json(by_alias=True), "utf-8")
    with pytest.raises(BaseModelError, match="or --response mobility"):
        base_model(str(path), "friction")
    path.write_text('{"schema": "model/1"}', "utf-8")
    with pytest.raises(BaseModelError, match=r"document: base: Field required$"):
        base_model(str(path), "friction")


def test_an_effect_that_is_not_known(tmp_path: Path) -> None:
    model = base_model("paper", "friction")
    strange: Model = model.model_copy(update={"effects": [Effect(id="magic", parameters={})]})
    with pytest.raises(UnknownEffectError, match="no effect 'magic'"):
        simulator_of(strange, MOUNT)
    assert isinstance(simulator_of(model, None), Simulator)
    path = tmp_path / "strange.json"
    for effect, told in (
        (Effect(id="magic", parameters={}), "strange.json: no effect 'magic' is known"),
        (
            Effect(id="direction_asymmetry", parameters={"shar": 0.1}),
            "strange.json: direction_asymmetry has no parameter 'shar'; it has: share",
        ),
    ):
        strange = model.model_copy(update={"effects": [effect]})
        path.write_text(strange.model_dump_json(by_alias=True), "utf-8")
        with pytest.raises(BaseModelError, match=told):
            base_model(str(path), "friction")
