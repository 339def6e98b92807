"""What the pages tell a reader to type: commands, configurations, names of the client."""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

import frictus
from frictus_service.cli.app import app
from frictus_service.config_file import parse

ROOT = Path(__file__).parents[1]
PAGES = (
    *(ROOT / "docs").glob("*.md"),
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "examples" / "README.md",
    ROOT / "clients" / "typescript" / "README.md",
)
COMMAND = re.compile(r"^(?:\$ |uv run |runuser .*-- )?frictus ([a-z][^#|]*)")


def blocks(page: Path, language: str) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def commands() -> Iterator[tuple[str, str]]:
    """Yield each page's name, and each command that it shows without what precedes it."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")
        for line in re.split(r"[\n`]", text):
            shown = COMMAND.match(line.strip())
            if shown is not None and (line.startswith(("    ", "$ ")) or "--" in line):
                yield page.name, shown[1]


def fault_of(shown: str) -> str:
    """Return what of a command does not exist; nothing where all does."""
    command: Any = typer.main.get_command(app)
    words = shown.split()
    while hasattr(command, "commands"):
        if not words or words[0] not in command.commands:
            return shown
        command = command.commands[words.pop(0)]
    known = {name for parameter in command.params for name in parameter.opts} | {"--help"}
    return " ".join({word for word in words if word.startswith("--")} - known)


def test_commands_and_options_exist() -> None:
    found = list(commands())
    assert len(found) > 100
    assert [each for each in found if fault_of(each[1])] == []


def test_a_wrong_command_and_a_wrong_option_are_seen() -> None:
    assert fault_of("studdy show a.h5") == "studdy show a.h5"
    assert fault_of("study show a.h5 --chek") == "--chek"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_configurations_are_accepted(page: Path) -> None:
    for block in blocks(page, "toml"):
        text = re.sub(r'sha256 = "[.…]+"', f'sha256 = "{64 * "0"}"', block)
        keys = tomllib.loads(text)
        # A map, a package, or what is added to a backend that another block configures.
        if not {"schema", "project"} & set(keys) and "kind" in keys.get(
            "backend", {"kind": ""}
        ):
            parse(text, page, runs_rig=False)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_names_of_the_client_exist(page: Path) -> None:
    for block in blocks(page, "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                assert node.value.id != "frictus" or hasattr(frictus, node.attr), node.attr
