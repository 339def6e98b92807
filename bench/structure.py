"""Numbers on the code itself: `uv run python bench/structure.py`, one line per package.

Counts what a reader meets: lines, files, small files, files that hold one definition, public
classes whose name means two things, entries of docstrings without a word or a shape, public
functions that return something and do not say what.
"""

import ast
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
SOURCES: Final = ("clients", "hardware", "service", "laboratory")
SMALL: Final = 40
LARGE: Final = 400
Function = ast.FunctionDef | ast.AsyncFunctionDef
ENTRY: Final = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: : (.*))?$")
SECTIONS: Final = ("Parameters", "Attributes")


@dataclass
class Count:
    """Of one package.

    Attributes
    ----------
    files, lines : int
    small, large, single : int
        Files of fewer than 40 lines, of more than 400, with one public definition.
    bare : int
        Parameters and attributes with neither description nor shape.
    no_returns : int
        Public functions that return a value and have no section on it, unless their first
        sentence says what they return.
    """

    files: int = 0
    lines: int = 0
    small: int = 0
    large: int = 0
    single: int = 0
    bare: int = 0
    no_returns: int = 0

    def add(self, other: "Count") -> None:
        """Add another count."""
        for field in fields(self):
            setattr(self, field.name, getattr(self, field.name) + getattr(other, field.name))


def bare_entries(docstring: str) -> Iterator[str]:
    """Yield the parameters and attributes of a docstring that have no word and no shape."""
    lines = docstring.splitlines()
    inside, pending = False, None
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if following and set(following.strip()) == {"-"}:
            inside = line.strip() in SECTIONS
            pending = None
            continue
        if not inside or not line.strip() or set(line.strip()) == {"-"}:
            continue
        if line.startswith(" "):
            pending = None
            continue
        if (found := ENTRY.match(line)) is None:
            continue
        if pending is not None:
            yield pending
        says = found[2] or ""
        described = following.startswith(" ") or "shape" in says or says.startswith("{")
        pending = None if described else found[1]
    if pending is not None:
        yield pending


def count_file(path: Path) -> tuple[Count, list[str]]:
    """Return the count of one file, and the names of its public classes."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    found = Count(files=1, lines=text.count("\n"))
    public = [node for node in tree.body if _is_public(node)]
    found.small, found.large = int(found.lines < SMALL), int(found.lines > LARGE)
    found.single = int(len(public) == 1)
    for node in ast.walk(tree):
        if not isinstance(node, ast.ClassDef | Function):
            continue
        docstring = ast.get_docstring(node)
        if docstring is None:
            continue
        found.bare += sum(1 for _ in bare_entries(docstring))
        if isinstance(node, Function) and not node.name.startswith("_"):
            found.no_returns += _is_silent_on_its_value(node, docstring)
    return found, [node.name for node in public if isinstance(node, ast.ClassDef)]


def _is_public(node: ast.stmt) -> bool:
    return isinstance(node, ast.ClassDef | Function) and not node.name.startswith("_")


def _is_silent_on_its_value(node: Function, docstring: str) -> bool:
    returns = "None" if node.returns is None else ast.unparse(node.returns)
    first = docstring.splitlines()[0]
    said = re.search(r"\b[Rr]eturns?\b|\b[Yy]ields?\b", docstring) is not None
    is_property = any("property" in ast.unparse(each) for each in node.decorator_list)
    return returns not in ("None", "NoReturn") and not said and not is_property and bool(first)


def main() -> None:
    """Print the table."""
    packages: dict[str, Count] = defaultdict(Count)
    total, classes = Count(), Counter[str]()
    for source in SOURCES:
        for path in sorted((ROOT / source).rglob("*.py")):
            count, names_of_classes = count_file(path)
            packages["/".join(path.relative_to(ROOT).parts[1:3])].add(count)
            total.add(count)
            classes.update(names_of_classes)
    names = [field.name for field in fields(Count)]
    write = sys.stdout.write
    write(f"{'package':34}" + "".join(f"{name:>11}" for name in names) + "\n")
    for name, count in [*sorted(packages.items()), ("total", total)]:
        if count.files > 1:
            write(f"{name:34}" + "".join(f"{value:11d}" for value in astuple(count)) + "\n")
    twice = sorted(name for name, times in classes.items() if times > 1)
    write(f"mean file: {total.lines / total.files:.0f} lines\n")
    write(f"class names with two meanings: {len(twice)} {' '.join(twice)}\n")


if __name__ == "__main__":
    main()
