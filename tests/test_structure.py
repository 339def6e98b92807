"""What `bench/structure.py` counts, where none is allowed."""

import importlib.util
import re
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def structure() -> ModuleType:
    spec = importlib.util.spec_from_file_location("structure", ROOT / "bench" / "structure.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclass looks there
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def counted(structure: ModuleType) -> dict[str, tuple[Any, list[str]]]:
    files = [path for source in structure.SOURCES for path in (ROOT / source).rglob("*.py")]
    return {str(path): structure.count_file(path) for path in files}


def test_every_parameter_and_attribute_is_described(
    counted: dict[str, tuple[Any, list[str]]],
) -> None:
    bare = {path: count.bare for path, (count, _) in counted.items() if count.bare}
    assert not bare


def test_no_file_has_more_than_400_lines(counted: dict[str, tuple[Any, list[str]]]) -> None:
    assert not [path for path, (count, _) in counted.items() if count.large]


def test_the_name_of_a_public_class_means_one_thing(
    counted: dict[str, tuple[Any, list[str]]],
) -> None:
    times = Counter(name for _, names in counted.values() for name in names)
    assert not [name for name, count in times.items() if count > 1]


def test_every_source_that_the_docs_name_exists() -> None:
    names = {path.name for path in ROOT.rglob("*.py") if ".venv" not in path.parts}
    named = {
        f"{page.name}: {name}"
        for page in (ROOT / "docs").glob("*.md")
        for name in re.findall(r"[\w./-]*\b(\w+\.py)\b", page.read_text(encoding="utf-8"))
        if name not in names
    }
    assert not named


def test_a_bare_entry_is_seen(structure: ModuleType) -> None:
    docstring = """Do it.

Parameters
----------
bare : float
said : float
    Of the finger.
shaped : ndarray, shape (n,)
last : int
"""
    assert list(structure.bare_entries(docstring)) == ["bare", "last"]
