"""Every schema in a recording is one that Foxglove and Lichtblick make fields of.

The rules are theirs: the root is an object, each field has one explicit type, an array items
of one type, which is no array; no alternatives, no null. Foxglove also takes references within
the schema, Lichtblick none.
"""

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from pydantic import BaseModel

from frictus.messages import MESSAGES, GuidanceState, SceneState
from frictus.textures import Beta, Component, Region, Scene, Spectrum
from frictus_service.recording.plain_schema import plain_schema
from frictus_service.recording.records import NOTES
from frictus_service.recording.writer import STATES

RECORDED = [MESSAGES[topic.message] for topic in STATES] + list(NOTES.values())
SCALARS = {"boolean", "string", "number", "integer"}


def refusal(schema: dict[str, Any], path: str = "") -> str | None:
    """Why a viewer would leave the channel out; None where it takes it."""
    if schema.get("type") != "object":
        return f"{path or 'root'}: no object"
    for name, field in schema.get("properties", {}).items():
        place = f"{path}.{name}"
        if {"anyOf", "oneOf", "allOf", "$ref", "prefixItems"} & field.keys():
            return f"{place}: alternatives, tuple or reference"
        inner = field.get("items", {}) if field.get("type") == "array" else field
        if inner.get("type") == "object":
            refused = refusal(inner, place)
            if refused is not None:
                return refused
        elif inner.get("type") not in SCALARS or "prefixItems" in inner:
            return f"{place}: type {inner.get('type')}"
    return None


@pytest.mark.parametrize("kind", RECORDED, ids=lambda kind: kind.__name__)
def test_viewers_take_the_schema(kind: type[BaseModel]) -> None:
    schema = plain_schema(kind)
    assert refusal(schema) is None
    assert schema["title"] == kind.__name__
    assert (
        schema["properties"].keys()
        == kind.model_json_schema(by_alias=True)["properties"].keys()
    )


def test_what_pydantic_writes_is_refused() -> None:
    refused = {kind.__name__ for kind in RECORDED if refusal(kind.model_json_schema())}
    assert {"GuidanceState", "RigStatus", "SceneState", "ModelState"} <= refused


def test_what_may_be_null_is_its_other_type() -> None:
    fields = plain_schema(GuidanceState)["properties"]
    assert fields["trials"]["type"] == "integer"
    assert fields["x_mm"]["type"] == "number"
    assert fields["span_mm"]["items"]["type"] == "number"
    assert fields["phase"]["enum"] == ["break", "approach", "record", "analyse", "done"]


def test_an_object_of_several_forms_has_the_fields_of_all() -> None:
    texture = plain_schema(SceneState)["properties"]["scene"]["properties"]["regions"]["items"][
        "properties"
    ]["texture"]
    spectrum = Spectrum(components=[Component(amplitude_n=0.1, cycles_per_mm=1.0)])
    for form in (spectrum, Beta(alpha=2.0, beta=1.0, rms_n=0.1)):
        region = Scene(regions=[Region(texture=form)]).model_dump(mode="json")["regions"][0]
        assert region["texture"].keys() <= texture["properties"].keys()
    assert texture["properties"]["kind"]["type"] == "string"


def test_types_that_nothing_describes_are_an_error() -> None:
    class Odd(BaseModel):
        value: list[int] | str

    with pytest.raises(TypeError, match=r"Odd\.value is array or string"):
        plain_schema(Odd)


def test_a_recording_has_these_schemas(make_whole: Any) -> None:
    path: Path = make_whole(20).path
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    found = {one.name: one for one in summary.schemas.values() if one.encoding == "jsonschema"}
    assert found.keys() == {kind.__name__ for kind in RECORDED}
    for one in found.values():
        assert refusal(json.loads(one.data)) is None
