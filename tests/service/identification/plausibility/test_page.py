"""The table of checks in the documentation is the one that is used."""

import re
from pathlib import Path

from frictus_service.identification.plausibility.checks import CHECKS
from frictus_service.identification.plausibility.judge import range_text

PAGE = Path(__file__).parents[4] / "docs" / "plausibility.md"


def table() -> str:
    rows = []
    for check in CHECKS:
        sentence = re.sub(r"{value[^}]*}", "x", check.sentence)
        accepted = range_text(*check.accepted)
        rows.append(f"| `{check.code}` | {check.severity} | {sentence} | {accepted} |")
    return "\n".join(rows)


def test_the_page_lists_all_checks() -> None:
    assert table() in PAGE.read_text(encoding="utf-8"), table()
