"""`docs/own_recordings.md` does what it says."""

import re
import tomllib
from pathlib import Path

import pytest

from frictus_service.data_import.channels import BY_NAME
from frictus_service.data_import.column_map import ColumnMap, map_text, parse_map
from frictus_service.data_import.formats.read import read_columns
from frictus_service.data_import.formats.text_layout import find_layout

PAGE = (Path(__file__).parents[3] / "docs" / "own_recordings.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    found: list[str] = re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    return found


def test_the_map_on_the_page_is_one_and_survives_being_saved() -> None:
    (text,) = blocks("toml")
    column_map = parse_map(tomllib.loads(text), "the page")
    assert parse_map(tomllib.loads(map_text(column_map)), "again") == column_map
    assert all(f"`{name}`" in PAGE for name in BY_NAME)
    entries = {field.alias or name for name, field in ColumnMap.model_fields.items()}
    assert all(f"`{name}`" in PAGE or name in ("schema", "channels") for name in entries)


def test_the_examples_in_python_write_what_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for code in blocks("python"):
        exec(code, {})
    (force,) = read_columns(tmp_path / "day1.h5").columns
    assert (force.name, force.unit) == ("daq.Ft", "N")
    (force,) = read_columns(tmp_path / "day1.parquet").columns
    assert (force.name, force.unit, force.values.tolist()) == ("Fx", "N", [0.1, 0.2])


def test_the_examples_of_text_are_understood() -> None:
    for example, columns in zip(blocks("text"), (4, 4), strict=True):
        layout = find_layout(example.encode())
        assert (layout.delimiter, layout.decimal, len(layout.names)) == (";", ",", columns)
