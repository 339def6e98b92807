"""Writes the message types of the TypeScript client: `uv run python bench/typescript_types.py`.

They are made from the AsyncAPI document, which is made from the code; a test compares them.
"""

import json
from pathlib import Path
from typing import Any, Final

from frictus_service.api.dashboard.asyncapi import document

TARGET: Final = Path(__file__).parents[1] / "clients" / "typescript" / "src" / "messages.ts"
HEAD: Final = """\
/**
 * The JSON messages of /v1/live, made by `uv run python bench/typescript_types.py`.
 * docs/asyncapi.json has ranges and units, docs/websocket.md what they mean together.
 */
"""


def type_of(schema: dict[str, Any]) -> str:
    """Return the type of a JSON schema."""
    if "$ref" in schema:
        return str(schema["$ref"].rpartition("/")[2])
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(json.dumps(value) for value in schema["enum"])
    if options := schema.get("anyOf") or schema.get("oneOf"):
        return " | ".join(dict.fromkeys(type_of(option) for option in options))
    match schema.get("type"):
        case "integer" | "number":
            return "number"
        case "string" | "boolean" | "null" as simple:
            return str(simple)
        case "array" if isinstance(schema.get("items"), list):
            return f"[{', '.join(type_of(item) for item in schema['items'])}]"
        case "array":
            return f"Array<{type_of(schema.get('items', {}))}>"
        case "object" if isinstance(schema.get("additionalProperties"), dict):
            return f"Record<string, {type_of(schema['additionalProperties'])}>"
    return "unknown"


def interface_of(name: str, schema: dict[str, Any]) -> str:
    """Return the interface of an object's schema."""
    required = schema.get("required", ())
    lines = [_comment(schema, ""), f"export interface {name} {{"]
    for field, shape in schema["properties"].items():
        lines.append(_comment(shape, "  "))
        lines.append(f"  {field}{'' if field in required else '?'}: {type_of(shape)};")
    return "\n".join([line for line in lines if line] + ["}"])


def _comment(schema: dict[str, Any], indent: str) -> str:
    first = " ".join(schema.get("description", "").split("\n\n")[0].split())
    return f"{indent}/** {first} */" if first else ""


def text() -> str:
    """Return the module."""
    page = document()
    schemas = page["components"]["schemas"]
    parts = [interface_of(name, schema) for name, schema in schemas.items()]
    for union, action in (("Asked", "receive"), ("Told", "send")):
        told = [
            said["messages"][0]["$ref"].rpartition("/")[2]
            for said in page["operations"].values()
            if said["action"] == action
        ]
        refs = [type_of(page["components"]["messages"][op]["payload"]) for op in told]
        names = " | ".join(ref for ref in refs if ref in schemas)
        parts.append(f"export type {union} = {names};")
    return "\n\n".join([HEAD.rstrip(), *parts]) + "\n"


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8", newline="\n")
