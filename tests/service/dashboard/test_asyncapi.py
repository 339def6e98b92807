"""The AsyncAPI document: what is served, what the docs keep and what the code does are one."""

import json
from pathlib import Path
from typing import Any, get_args

import jsonschema_rs
import pytest
from pydantic import TypeAdapter
from tests.service.dashboard.page import page_at
from tests.typescript.package import node_modules

from frictus.websocket.messages import Asked, Watch
from frictus_service.api.dashboard.asyncapi import ANSWERS, TOLD, document, text

pytestmark = pytest.mark.timeout(300)  # the first installs what AsyncAPI's schema is in
DOCS = Path(__file__).parents[3] / "docs" / "asyncapi.json"


@pytest.fixture(scope="module")
def page() -> Any:
    return document()


def test_the_docs_keep_what_the_code_makes() -> None:
    fault = "python -m frictus_service.api.dashboard.asyncapi > docs/asyncapi.json"
    assert DOCS.read_text(encoding="utf-8") == text(), fault


def test_it_is_asyncapi(page: Any) -> None:
    schemas = node_modules() / "@asyncapi" / "specs" / "schemas" / "3.0.0.json"
    schema = json.loads(schemas.read_text(encoding="utf-8"))
    faults = list(jsonschema_rs.validator_for(schema).iter_errors(page))
    assert [(fault.instance_path, fault.message[:100]) for fault in faults] == []
    spoilt = page | {"operations": {"arm": {"action": "do"}}}
    assert not jsonschema_rs.validator_for(schema).is_valid(spoilt)


def test_every_reference_leads_somewhere(page: Any) -> None:
    waiting, found = [page], 0
    while waiting:
        part = waiting.pop()
        waiting += part.values() if isinstance(part, dict) else part
        waiting = [one for one in waiting if isinstance(one, dict | list)]
        if isinstance(part, dict) and "$ref" in part:
            target = page
            for key in part["$ref"].removeprefix("#/").split("/"):
                target = target[key]
            found += 1
    assert found > 100


def test_every_message_of_the_code_is_in_it(page: Any) -> None:
    ops = {str(get_args(kind.model_fields["op"].annotation)[0]) for kind in get_args(Asked)}
    received = {
        name for name, said in page["operations"].items() if said["action"] == "receive"
    }
    assert received == ops | {"update"}
    assert ANSWERS.keys() <= ops
    told = {str(get_args(kind.model_fields["op"].annotation)[0]) for kind in TOLD}
    assert {f"tell_{op}" for op in told} <= page["operations"].keys()


def test_what_a_rig_tells_fits_its_schema(page: Any, port: int) -> None:
    with page_at(port, who="render") as open_page:
        open_page.say("watch", rig="rig1")
        open_page.say("arm", rig="rig1")
        open_page.say("open_stream", rig="rig1", peak_n=0.05)
        open_page.wait("stream_opened")
        open_page.say("close_stream")
        waited = {"status", "scene", "model", "finger", "armed", "stream_closed"}
        while not waited <= {told["op"] for told in open_page.told}:
            open_page.read()
    components = {"components": page["components"]}
    for told in open_page.told:
        payload = page["components"]["messages"][told["op"]]["payload"]
        faults = jsonschema_rs.validator_for(payload | components).iter_errors(told)
        assert [(fault.instance_path, fault.message[:100]) for fault in faults] == []


def test_what_the_schema_allows_is_read(page: Any) -> None:
    schema = page["components"]["schemas"]["Watch"]
    assert schema["additionalProperties"] is False
    assert set(schema["required"]) == {"op", "rig"}
    assert TypeAdapter(Watch).json_schema()["properties"].keys() == schema["properties"].keys()
