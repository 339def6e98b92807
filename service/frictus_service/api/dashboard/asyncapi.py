"""The AsyncAPI document of `/v1/live`, made from its messages; served, and kept in the docs.

``python -m frictus_service.api.dashboard.asyncapi`` prints it; a test compares the two. It is
https://www.asyncapi.com/docs/reference/specification/v3.0.0.
"""

import functools
import json
import re
import sys
from collections.abc import Iterable
from typing import Any, Final, get_args

from fastapi import APIRouter
from fastapi.responses import Response
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from frictus.messages import MESSAGES
from frictus.websocket.messages import PROTOCOL, VALUES, Asked, Told

TOLD: Final[tuple[type[BaseModel], ...]] = get_args(Told)
ANSWERS: Final = {
    "hello": ("welcome",),
    "arm": ("armed",),
    "disarm": ("disarmed",),
    "set_scene": ("scene_set",),
    "open_stream": ("stream_opened",),
    "close_stream": ("stream_closed",),
    "ping": ("pong",),
}
"""What answers a message, where it is not refused."""
BINARY: Final = {
    "update": (
        "One period of friction for the texture stream that is open: the StreamFrame of "
        "docs/protocol.md, with the ticket of `stream_opened`."
    ),
    "frame": "Samples of a stream, or states of the finger: see docs/websocket.md.",
}
router = APIRouter(include_in_schema=False)


def _op_of(kind: type[BaseModel]) -> str:
    return str(get_args(kind.model_fields["op"].annotation)[0])


def _schemas() -> dict[str, Any]:
    sent = [(kind, "validation") for kind in get_args(Asked)]
    told = [(kind, "serialization") for kind in TOLD]
    passed_on = [(MESSAGES[topic.message], "serialization") for topic in VALUES.values()]
    _, page = models_json_schema(
        [*sent, *told, *passed_on],  # type: ignore[list-item]
        ref_template="#/components/schemas/{model}",
    )
    schemas: dict[str, Any] = page["$defs"]
    read = _reachable([kind.__name__ for kind in get_args(Asked)], schemas)
    for name, schema in schemas.items():
        properties, required = schema["properties"], schema.get("required", [])
        if name in read:  # tags have a default in the code, none on the wire
            required += [tag for tag, part in properties.items() if "const" in part]
        else:  # the service leaves nothing out
            required += properties
        schema["required"] = list(dict.fromkeys(required))
    for op, topic in VALUES.items():
        schemas[_of_rig(op)] = {
            "title": _of_rig(op),
            "description": f"The newest `{topic.suffix}` of the watched rig.",
            "type": "object",
            "properties": {
                "op": {"const": op, "type": "string"},
                "rig": {"type": "string"},
                op: {"$ref": f"#/components/schemas/{topic.message}"},
            },
            "required": ["op", "rig", op],
        }
    return {name: _in_draft_07(schema) for name, schema in schemas.items()}


def _reachable(names: list[str], schemas: dict[str, Any]) -> set[str]:
    """Return the names of schemas, and of those that they refer to."""
    found: set[str] = set()
    while names:
        if (name := names.pop()) not in found:
            found.add(name)
            names += re.findall(r'"#/components/schemas/(\w+)"', json.dumps(schemas[name]))
    return found


def _in_draft_07(schema: Any) -> Any:
    """Return a schema as AsyncAPI has them: of draft 7, without OpenAPI's discriminators."""
    if isinstance(schema, list):
        return [_in_draft_07(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        {"prefixItems": "items"}.get(key, key): _in_draft_07(part)
        for key, part in schema.items()
        if not (key == "discriminator" and "propertyName" in part)
    }


def _of_rig(op: str) -> str:
    return f"{op.capitalize()}Told"


def _operation(op: str, channel: dict[str, str], action: str) -> dict[str, Any]:
    said: dict[str, Any] = {"action": action, "channel": channel, "messages": [_in_channel(op)]}
    if op in ANSWERS:
        answers = [_in_channel(answer) for answer in (*ANSWERS[op], "refused")]
        said["reply"] = {"channel": channel, "messages": answers}
    return said


def _in_channel(op: str) -> dict[str, str]:
    return {"$ref": f"#/channels/live/messages/{op}"}


def document() -> dict[str, Any]:
    """Return the AsyncAPI 3.0 document of the WebSocket."""
    schemas = _schemas()
    payloads = {_op_of(kind): kind.__name__ for kind in (*get_args(Asked), *TOLD)}
    payloads |= {op: _of_rig(op) for op in VALUES}
    messages: dict[str, Any] = {
        op: {
            "name": op,
            "summary": schemas[name].get("description", "").split("\n\n")[0],
            "contentType": "application/json",
            "payload": {"$ref": f"#/components/schemas/{name}"},
        }
        for op, name in payloads.items()
    }
    for name, summary in BINARY.items():
        messages[name] = {
            "name": name,
            "summary": summary,
            "contentType": "application/octet-stream",
            "payload": {"type": "string", "format": "binary"},
        }
    live = {"$ref": "#/channels/live"}
    asked = [*(_op_of(kind) for kind in get_args(Asked)), "update"]
    said: Iterable[str] = [op for op in messages if op not in asked]
    return {
        "asyncapi": "3.0.0",
        "info": {
            "title": "frictus: the WebSocket /v1/live",
            "version": f"{PROTOCOL}.0",
            "description": "JSON as text frames, samples and textures as binary frames; what "
            "the fields mean together is in docs/websocket.md.",
            "license": {"name": "BSD-3-Clause"},
        },
        "defaultContentType": "application/json",
        "servers": {"local": {"host": "127.0.0.1:8420", "protocol": "ws"}},
        "channels": {
            "live": {
                "address": "/v1/live",
                "messages": {op: {"$ref": f"#/components/messages/{op}"} for op in messages},
            }
        },
        "operations": {op: _operation(op, live, "receive") for op in asked}
        | {f"tell_{op}": _operation(op, live, "send") for op in said},
        "components": {"messages": messages, "schemas": schemas},
    }


@functools.cache
def text() -> str:
    """Return the document as the docs keep it; made once."""
    return json.dumps(document(), indent=1, ensure_ascii=False) + "\n"


@router.get("/v1/asyncapi.json")
def reference() -> Response:
    """Answer with the document; as the reference of REST, it needs no token."""
    return Response(text(), media_type="application/json")


if __name__ == "__main__":
    sys.stdout.write(text())
