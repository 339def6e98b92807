"""Reads the configuration file: errors name the line at fault and what is accepted."""

import difflib
import json
import re
import reprlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from frictus.errors import complaint
from frictus.files import MAX_TOML_BYTES, read_bounded, read_toml
from frictus_service.config import DEFAULT_FILE, Config, Place
from frictus_service.errors import ConfigurationError

_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
_SECRET = (("value",), ("url",))
"""Keys of tokens and passwords, which an error does not repeat."""
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxlong = 80
_KEY = re.compile(r"^\s*([A-Za-z0-9_.\"'\s-]+?)\s*=")


def load(path: Path | None = None, *, runs_rig: bool = False) -> Config:
    """Read a configuration file.

    Parameters
    ----------
    path : Path or None
        None reads `frictus.toml` of the working folder where there is one, and takes the
        defaults where there is none. Relative paths in the file are relative to it.
    runs_rig : bool
        Whether the rig runs on this machine: then the files it is made from must be here. One
        file may configure several machines, and the others have no use for them.

    Raises
    ------
    ConfigurationError
        If the file cannot be read or says something that is not accepted; the text names the
        line of each fault.
    """
    if path is None:
        if not DEFAULT_FILE.exists():
            return Config()
        path = DEFAULT_FILE
    try:
        # Editors on Windows put a mark before it.
        text = read_bounded(path, MAX_TOML_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise ConfigurationError(
            f"{path}:{line}: no text in UTF-8: have the editor save it as UTF-8"
        ) from error
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read: {error.strerror}") from error
    return parse(text, path, runs_rig=runs_rig)


def parse(text: str, path: Path, *, runs_rig: bool = False) -> Config:
    """Return the configuration that `text` states; `path` is named in errors.

    Raises
    ------
    ConfigurationError
        As `load`.
    """
    try:
        document = read_toml(text)
        as_json = json.dumps(document, default=str)
    except RecursionError as error:  # as JSON: a key of many parts is as many tables
        message = "lists or tables within each other, deeper than any setting has them"
        raise ConfigurationError(f"{path}:1: {message}") from error
    except ValueError as error:  # integers of 4300 digits: no TOMLDecodeError
        place = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        line = place[1] if place else str(text.count("\n") + 1)
        raise ConfigurationError(f"{path}:{line}: not TOML: {error}") from error
    lines = _lines_of_keys(text)
    if refused := [place for place, value in _texts_in(document) if not value.isprintable()]:
        raise ConfigurationError(
            "\n".join(
                f"{path}:{_line_of(place, lines)}: {'.'.join(map(str, place))}: control and "
                "formatting characters are in no name, path or address"
                for place in refused
            )
        )
    try:
        # By way of JSON, whose strict mode still turns text into paths and arrays into tuples.
        config = Config.model_validate_json(as_json, strict=True)
    except ValidationError as error:
        faults = sorted(_describe(fault, document, lines) for fault in error.errors())
        told = [f"{path}:{line}: {what}" for line, what in faults]
        raise ConfigurationError("\n".join(told)) from error
    folder = path.parent
    model_file = config.model_file and folder / config.model_file
    located_config = config.model_copy(
        update={
            "model_file": model_file,
            "textures": folder / config.textures,
            "recordings": folder / config.recordings,
            "studies": folder / config.studies,
            "registry": config.registry.within(folder),
            "tracker": config.tracker.within(folder),
            "security": config.security and config.security.within(folder),
            "backend": config.backend.within(folder),
        }
    )
    absent = [
        f"{path}:{_line_of(place, lines)}: {'.'.join(map(str, place))}: there is no file {file}"
        for place, file in located_config.rig_files.items()
        if runs_rig and not file.is_file()
    ]
    if absent:
        raise ConfigurationError("\n".join(absent))
    return located_config


def _texts_in(document: Any, place: Place = ()) -> Iterator[tuple[Place, str]]:
    """Yield the values that are texts, and where they stand."""
    if isinstance(document, str):
        yield place, document
    elif isinstance(document, dict):
        for key, value in document.items():
            yield from _texts_in(value, (*place, key))
    elif isinstance(document, list):
        for index, value in enumerate(document):
            yield from _texts_in(value, (*place, index))


def _describe(fault: Any, document: dict[str, Any], lines: dict[Place, int]) -> tuple[int, str]:
    """Return the line of a fault and what is wrong there."""
    place = _place_in(document, fault["loc"])
    if fault["type"] == "misfit":
        place = (*place, *fault["ctx"]["place"])
    elif fault["type"].startswith("union_tag"):
        place = (*place, "kind")
    line = _line_of(place, lines)
    dotted = ".".join(str(part) for part in place) or "the file"
    message = complaint(fault)
    if fault["type"] == "extra_forbidden":
        accepted = sorted(_schema_at(fault["loc"][:-1]).get("properties", {}))
        unknown = str(fault["loc"][-1])
        near = difflib.get_close_matches(unknown, accepted, 1)
        hint = f"; did you mean {near[0]!r}?" if near else "."
        message = f"unknown key{hint} Accepted here: {', '.join(accepted)}"
    elif fault["type"] == "union_tag_not_found":
        kinds = sorted(_schema_at(fault["loc"])["discriminator"]["mapping"])
        message = f"this key is required here; accepted: {', '.join(map(repr, kinds))}"
    elif fault["type"] == "missing":
        message = "this key is required here"
    elif not isinstance(fault["input"], dict | list) and place[-1:] not in _SECRET:
        message = f"{message}, not {_SHORT.repr(fault['input'])}"
    return line, f"{dotted}: {message}"


def _line_of(place: Place, lines: dict[Place, int]) -> int:
    """Return the line of a key, or of the innermost table above it that is written down."""
    return next((lines[place[:n]] for n in range(len(place), 0, -1) if place[:n] in lines), 1)


def _place_in(document: Any, loc: Place) -> Place:
    """Return `loc` without the union tags that pydantic puts between keys."""
    place: list[str | int] = []
    here = document
    for part in loc:
        found = (isinstance(here, dict) and part in here) or (
            isinstance(here, list) and isinstance(part, int)
        )
        if found:
            here = here[part]
            place.append(part)
    last = loc[-1:]
    if last and (not place or place[-1] != last[0]) and isinstance(last[0], str):
        place.append(last[0])  # a key that is missing
    return tuple(place)


def _schema_at(loc: Place) -> dict[str, Any]:
    """Return the JSON schema of the section at `loc`."""
    schema = Config.model_json_schema()
    definitions = schema["$defs"]

    def resolved(node: dict[str, Any]) -> dict[str, Any]:
        while "$ref" in node:
            node = definitions[node["$ref"].rsplit("/", 1)[1]]
        return node

    node = resolved(schema)
    for part in loc:
        mapping = node.get("discriminator", {}).get("mapping", {})
        if part in mapping:
            node = resolved({"$ref": mapping[part]})
        elif isinstance(part, int):
            node = resolved(node.get("items", {}))
        else:
            node = resolved(node.get("properties", {}).get(part, node))
    return node


def _lines_of_keys(text: str) -> dict[Place, int]:
    """Return the line of each table and key; keys within inline tables count as their key's."""
    lines: dict[Place, int] = {}
    counts: dict[Place, int] = {}
    table: Place = ()
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            table = _split(header[2])
            if header[1] == "[[":
                index = counts.get(table, -1) + 1
                counts[table] = index
                lines.setdefault(table, number)
                table = (*table, index)
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            place = table
            for part in _split(key[1]):
                place = (*place, part)
                lines.setdefault(place, number)
    return lines


def _split(dotted: str) -> Place:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))
