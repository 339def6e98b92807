"""Prints the tables of `docs/protocol.md` from the code: ``python -m frictus.protocol``.

So the document cannot say anything else than the code does; a test compares them.
"""

import sys
from collections.abc import Iterable
from typing import Any, Final, get_args

import numpy as np

from frictus.block import Block, Flag
from frictus.keys import CALLS, RECORDER_CALLS, ROOT, STREAMS, TOPICS
from frictus.messages import MESSAGES, RefusalCode, SafetyState
from frictus.stream import StreamFrame

EXAMPLE_BLOCK: Final = Block(
    stream=1,
    run=7,
    sequence=41,
    first_sample=4_100,
    utc_ns=1_767_225_600_000_000_000,
    uncertainty_ns=250_000,
    sample_rate_hz=20_000.0,
    flags=Flag.ARMED | Flag.SIMULATED,
    data=np.array([[0.25, -0.5], [0.0, 0.125], [0.5, 0.5]], dtype=np.float32),
)
EXAMPLE_FRAME: Final = StreamFrame(
    ticket=9,
    sequence=3,
    utc_ns=1_767_225_600_000_000_000,
    ttl_ms=200,
    period=2.5,
    spatial=True,
    angle_deg=90.0,
    friction_n=np.array([0.1, 0.0, -0.1, 0.0], dtype=np.float32),
)


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def topics_table() -> str:
    """Return the table of published keys with their service."""
    return _table(
        ("key below the rig", "message", "unit", "priority", "congestion", "express", "cached"),
        (
            (
                f"`{topic.suffix}`",
                topic.message,
                topic.unit,
                topic.qos.priority,
                "block" if topic.qos.block else "drop",
                "yes" if topic.qos.express else "no",
                "last 1" if topic.latest else "no",
            )
            for topic in TOPICS
        ),
    )


def calls_table() -> str:
    """Return the table of calls."""
    answered = (("the rig", CALLS), ("its recorder", RECORDER_CALLS))
    return _table(
        ("key below the rig", "request", "answered by"),
        (
            (f"`@rpc/{name}`", f"`{request}`", who)
            for who, calls in answered
            for name, request in calls.items()
        ),
    )


def streams_table() -> str:
    """Return the table of stream ids."""
    return _table(
        ("stream id", "key below the rig", "channels", "unit"),
        (
            (
                str(number),
                f"`{topic.suffix}`",
                topic.message.removeprefix("Block: "),
                topic.unit,
            )
            for number, topic in STREAMS.items()
        ),
    )


def flags_table() -> str:
    """Return the table of a block's flags."""
    return _table(
        ("bit", "value", "flag"),
        ((str(flag.bit_length() - 1), str(int(flag)), flag.name or "") for flag in Flag),
    )


def messages_tables() -> str:
    """Return one table of fields for each JSON message and what is nested in it."""
    definitions: dict[str, Any] = {}
    for name, message in MESSAGES.items():
        schema = message.model_json_schema(mode="validation")
        for nested, definition in schema.pop("$defs", {}).items():
            definitions.setdefault(nested, definition)
        definitions[name] = schema
    tables = []
    for name in sorted(definitions):
        definition = definitions[name]
        if "properties" in definition:
            required = definition.get("required", ())
            rows = (
                (f"`{field}`", _type_of(shape), "yes" if field in required else "no")
                for field, shape in definition["properties"].items()
            )
            tables.append(f"#### {name}\n\n" + _table(("field", "type", "required"), rows))
    return "\n\n".join(tables)


def _type_of(shape: dict[str, Any]) -> str:
    """Return a JSON schema's type in words short enough for a table."""
    if "$ref" in shape:
        return str(shape["$ref"]).rpartition("/")[2]
    if "const" in shape:
        return f'"{shape["const"]}"'
    if "enum" in shape:
        return " or ".join(f'"{value}"' for value in shape["enum"])
    options = shape.get("anyOf") or shape.get("oneOf") or shape.get("allOf")
    if options:
        return " or ".join(dict.fromkeys(_type_of(option) for option in options))
    kind = str(shape.get("type", "any"))
    if "prefixItems" in shape:
        return "[" + ", ".join(_type_of(item) for item in shape["prefixItems"]) + "]"
    if kind == "array":
        kind = f"list of {_type_of(shape.get('items', {}))}"
    return kind + _limits_of(shape)


def _limit(value: float) -> str:
    return "2^63" if value == 2**63 else "-2^63" if value == -(2**63) else f"{value:g}"


def _limits_of(shape: dict[str, Any]) -> str:
    signs = {
        "minimum": "≥",
        "exclusiveMinimum": ">",
        "maximum": "≤",
        "exclusiveMaximum": "<",
        "minItems": "items ≥",
        "maxItems": "items ≤",
        "minLength": "length ≥",
        "maxLength": "length ≤",
    }
    limits = [f"{sign} {_limit(shape[name])}" for name, sign in signs.items() if name in shape]
    return f" ({', '.join(limits)})" if limits else ""


def _words(union: Any) -> str:
    return ", ".join(f"`{word}`" for word in get_args(union))


def _hex(frame: bytes) -> str:
    rows = (frame[start : start + 16] for start in range(0, len(frame), 16))
    return "```hex\n" + "\n".join(row.hex(" ") for row in rows) + "\n```"


def sections() -> dict[str, str]:
    """Return every generated part of `docs/protocol.md` by its title."""
    return {
        f"Published keys below `{ROOT}/{{site}}/{{rig}}`": topics_table(),
        "Calls": calls_table(),
        "Streams": streams_table(),
        "Block flags": flags_table(),
        "Refusal codes": _words(RefusalCode),
        "Safety states": _words(SafetyState),
        "Test vector: block": _hex(EXAMPLE_BLOCK.pack()),
        "Test vector: stream frame": _hex(EXAMPLE_FRAME.pack()),
        "Message fields": messages_tables(),
    }


def main() -> None:
    """Print all generated parts."""
    for title, body in sections().items():
        sys.stdout.write(f"### {title}\n\n{body}\n\n")


if __name__ == "__main__":
    main()
