"""JSON schemas that viewers of MCAP files can read: one explicit type for everything.

Foxglove and Lichtblick make a table of fields from a schema before they show a message. They
take objects, arrays of one type, numbers, strings, booleans. Pydantic also writes alternatives
(`anyOf`), tuples (`prefixItems`) and references: a channel with one of them is left out whole.
https://docs.foxglove.dev/docs/getting-started/custom/custom-schema-encodings; the parser is
Lichtblick's `packages/mcap-support/src/parseJsonSchema.ts`.
"""

from typing import Any, Final

from pydantic import BaseModel

Schema = dict[str, Any]
KEPT: Final = (
    "title",
    "description",
    "enum",
    "minimum",
    "maximum",
    "exclusiveMinimum",
    "exclusiveMaximum",
    "minLength",
    "maxLength",
    "minItems",
    "maxItems",
)
NUMBERS: Final = {"integer", "number"}


def plain_schema(model: type[BaseModel]) -> Schema:
    """Return the schema of a message with explicit types alone.

    It allows more than the model: what may be null is described by its other type, an object
    that has several forms by the fields of them all. Arrays of arrays are left out, since no
    viewer makes fields of them; in the message they are shown all the same.

    Parameters
    ----------
    model : type of BaseModel
        The message.

    Raises
    ------
    TypeError
        If a field has types that no single one describes.
    """
    schema = model.model_json_schema(by_alias=True)
    return _plain(schema, schema.get("$defs", {}), model.__name__)


def _plain(schema: Schema, definitions: Schema, path: str) -> Schema:
    if "$ref" in schema:
        name = schema["$ref"].removeprefix("#/$defs/")
        return _plain({**definitions[name], **_without(schema, "$ref")}, definitions, path)
    for keyword in ("anyOf", "oneOf", "allOf"):
        if keyword in schema:
            forms = [_plain(one, definitions, path) for one in schema[keyword]]
            return _merged([one for one in forms if one["type"] != "null"], path)
    kind = schema.get("type") or _type_of(schema, path)
    plain = {"type": kind} | {key: schema[key] for key in KEPT if key in schema}
    if kind == "object":
        fields = {
            name: _plain(field, definitions, f"{path}.{name}")
            for name, field in schema.get("properties", {}).items()
        }
        plain["properties"] = {
            name: field for name, field in fields.items() if not _is_nested(field)
        }
        plain["required"] = [
            name for name in schema.get("required", []) if name in plain["properties"]
        ]
    elif kind == "array":
        items = schema.get("prefixItems") or [schema["items"]]
        plain["items"] = _merged([_plain(one, definitions, f"{path}[]") for one in items], path)
    return plain


def _is_nested(field: Schema) -> bool:
    """Return whether it holds arrays of arrays, of which no viewer makes fields."""
    return field["type"] == "array" and bool(field["items"]["type"] == "array")


def _type_of(schema: Schema, path: str) -> str:
    values = [schema["const"]] if "const" in schema else schema.get("enum", [])
    if values and all(isinstance(value, str) for value in values):
        return "string"
    raise TypeError(f"{path} has no explicit type: {schema}")


def _merged(forms: list[Schema], path: str) -> Schema:
    """Return what describes every one of several forms."""
    merged, *others = forms
    for other in others:
        kinds = {merged["type"], other["type"]}
        if kinds == {"object"}:
            both = merged["properties"].keys() & other["properties"].keys()
            shared = {
                name: _merged([form["properties"][name] for form in (merged, other)], path)
                for name in both
            }
            required = [name for name in merged["required"] if name in other["required"]]
            properties = merged["properties"] | other["properties"] | shared
            merged = {"type": "object", "properties": properties, "required": required}
        elif kinds <= NUMBERS or len(kinds) == 1:
            kind = "number" if "number" in kinds else merged["type"]
            merged = {"type": kind} | _items(merged, other, path)
        else:
            raise TypeError(f"{path} is {merged['type']} or {other['type']}: no type is both")
    return merged


def _items(one: Schema, other: Schema, path: str) -> Schema:
    if "items" not in one:
        return {}
    return {"items": _merged([one["items"], other["items"]], f"{path}[]")}


def _without(schema: Schema, key: str) -> Schema:
    return {name: value for name, value in schema.items() if name != key}
