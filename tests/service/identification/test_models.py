"""Models from an identification."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.identification.observed import Bench, Finger, observations

from frictus.model import FirstOrderSpeedLaw, Model
from frictus_service.errors import NoModelError
from frictus_service.identification.analysis import identify
from frictus_service.identification.documents import Identification, Settings
from frictus_service.identification.models import participant_models, population_model
from frictus_service.registry.documents import check_provenance

SMALL = Bench(
    tones_hz=(30.0, 120.0, 450.0, 2000.0),
    speeds=(20.0, 100.0),
    forces=(0.4,),
    seconds=3.0,
    speed_wander=0.02,
)


def identified(fingers: list[Finger], bench: Bench, rng: np.random.Generator) -> Identification:
    return identify(
        observations(fingers, bench, rng),
        path="a.h5",
        sha256="ab" * 32,
        settings=Settings(mixed_models=False, sweeps=False),
    )


def test_models_carry_law_covariance_delay_and_origin(rng: np.random.Generator) -> None:
    found = identified([Finger(delay_s=80e-6), Finger(gain_n=0.2)], SMALL, rng)
    models = participant_models(found)
    assert [(m.participant, m.response) for m in models] == [
        ("P01", "friction"),
        ("P01", "mobility"),
        ("P02", "friction"),
        ("P02", "mobility"),
    ]
    for model in [*models, population_model(found)]:
        check_provenance(model)
        assert Model.model_validate_json(model.to_json()) == model
        assert model.covariance is not None
        matrix = np.array(model.covariance.matrix)
        assert np.all(
            np.linalg.eigvalsh(matrix / np.outer(*2 * [np.diag(matrix) ** 0.5])) > -1e-9
        )
        assert model.covariance.parameters[-1] == "skew_s"
        low, high = model.validity.speed_mm_s
        assert low == pytest.approx(20.0, rel=0.1)
        assert high == pytest.approx(100.0, rel=0.1)
    law = models[0].base
    assert isinstance(law, FirstOrderSpeedLaw)
    assert law.slope_hz_per_mm_s == pytest.approx(13.811, rel=0.2)
    assert models[0].skew_s == pytest.approx(80e-6, abs=10e-6)
    assert models[0].covariance is not None
    assert models[0].covariance.parameters[:3] == ["gain_n", "cutoff_0_hz", "slope_hz_per_mm_s"]


def test_one_person_is_no_population(rng: np.random.Generator) -> None:
    with pytest.raises(NoModelError, match="two participants"):
        population_model(identified([Finger()], SMALL, rng))


def test_a_population_is_of_those_who_have_a_law(rng: np.random.Generator) -> None:
    seen = observations([Finger(), Finger(gain_n=0.2)], SMALL, rng)
    for one in observations([Finger()], replace(SMALL, speeds=(180.0,)), rng):
        info = replace(one.info, participant="P03")
        seen.append(replace(one, info=info))
    found = identify(seen, settings=Settings(mixed_models=False, sweeps=False))
    assert [person.friction is not None for person in found.participants] == [True] * 3
    model = population_model(found)
    assert model.provenance["participants"] == 2
    assert model.validity.speed_mm_s[1] == pytest.approx(100.0, rel=0.1)


def test_a_law_holds_where_it_was_measured(rng: np.random.Generator) -> None:
    """One tone at another speed tells no cutoff there, and is not part of the law."""
    seen = observations([Finger()], SMALL, rng)
    beyond = replace(SMALL, speeds=(180.0,), tones_hz=(120.0,), seconds=30.0)
    for one in observations([Finger()], replace(beyond, info={"drive_vpp": 100.0}), rng):
        seen.append(replace(one, info=replace(one.info, id="beyond", order=100)))
    found = identify(seen, settings=Settings(mixed_models=False, sweeps=False))
    (model, _) = participant_models(found)
    assert model.validity.speed_mm_s[1] == pytest.approx(100.0, rel=0.1)
    assert model.validity.drive_vpp == (150.0, 150.0)


def test_a_cutoff_below_zero_at_rest_is_said_not_stored(rng: np.random.Generator) -> None:
    found = identified([Finger(cutoff_0_hz=-150.0, slope=20.0)], SMALL, rng)
    assert [model.response for model in participant_models(found)] == ["mobility"]
    assert any("P01" in note and "not positive" in note for note in found.notes)
