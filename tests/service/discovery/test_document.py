"""`discovery/1`: the keys of the format, what is refused, and what survives being written."""

import json
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from tests.service.discovery.found import discovery, gain, left, pair

from frictus_service.discovery.document import CannotTell, Discovery, Gain, Unexplained
from frictus_service.discovery.report.page import write

KEYS = {
    "schema",
    "study",
    "response",
    "base_model",
    "extended_model",
    "verdict",
    "causes",
    "cannot_tell",
    "unexplained",
    "explained_share",
    "gain",
}
CAUSE_KEYS = {
    "id",
    "statement",
    "verdict",
    "parameters",
    "p_value",
    "gain",
    "alternatives",
    "next_experiment",
}
GAIN_KEYS = {"heldout_loglik", "ci95", "residual_db", "residual_deg"}


def everything(rng: np.random.Generator) -> Discovery:
    return discovery(
        rng, verdict="partly_explained", cannot_tell=(pair(),), unexplained=(left(),)
    )


def test_the_keys_are_those_of_the_format(rng: np.random.Generator) -> None:
    said: dict[str, Any] = json.loads(everything(rng).to_json())
    assert said["schema"] == "discovery/1"
    assert said.keys() >= KEYS
    assert said["study"].keys() == {
        "path",
        "sha256",
        "simulated",
        "participants",
        "trials",
        "trials_used",
        "left_out",
    }
    assert said["base_model"]["schema"] == said["extended_model"]["schema"] == "model/1"
    (cause,) = said["causes"]
    assert cause.keys() >= CAUSE_KEYS
    assert cause["gain"].keys() == said["gain"].keys() == GAIN_KEYS
    for estimate in cause["parameters"].values():
        assert estimate.keys() >= {"value", "ci95", "unit"}
    assert cause["alternatives"][0].keys() == {"id", "similarity", "separating_experiment"}
    assert said["cannot_tell"][0].keys() >= {"between", "separating_experiment"}
    assert said["unexplained"][0].keys() == {"channel", "band_hz", "covariate", "p_value"}


def test_it_is_read_back_as_it_was(rng: np.random.Generator) -> None:
    found = everything(rng)
    assert Discovery.model_validate_json(found.to_json()) == found


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        (CannotTell, {"between": ("gain_drift", "gain_drift")}),
        (CannotTell, {"between": ("gain_drift",)}),
        (Unexplained, {"p_value": 1.5}),
        (Unexplained, {"band_hz": (float("nan"), 3.0)}),
        (Gain, {"heldout_loglik": float("inf")}),
        (Discovery, {"verdict": "perhaps"}),
        (Discovery, {"seed": -1}),
    ],
)
def test_what_cannot_be_is_refused(
    rng: np.random.Generator, kind: Any, change: dict[str, Any]
) -> None:
    good = {
        CannotTell: pair(),
        Unexplained: left(),
        Gain: gain(),
        Discovery: everything(rng),
    }[kind]
    said = good.model_dump(by_alias=True)
    assert kind.model_validate(said) == good
    with pytest.raises(ValidationError):
        kind.model_validate(said | change)


def test_files_are_written_over(rng: np.random.Generator, tmp_path: Any) -> None:
    folder = tmp_path / "a" / "b"
    write(everything(rng), folder)
    found = discovery(rng)
    written = write(found, folder)
    assert {path.name for path in folder.iterdir()} == {path.name for path in written}
    assert Discovery.model_validate_json((folder / "report.json").read_bytes()) == found
    model = type(found.extended_model).model_validate_json(
        (folder / "extended_model.json").read_bytes()
    )
    assert model == found.extended_model
