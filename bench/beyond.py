"""Write the table of the studies beyond the catalogue: `python bench/beyond.py --help`.

The studies themselves: `python -m tests.blind.beyond bench/beyond.jsonl`.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

sys.path.insert(0, str(Path(__file__).parents[1]))  # so that a script finds the tests

from tests.blind.beyond import DESIGNS
from tests.blind.campaign import read

ROOT: Final = Path(__file__).parents[1]
HEAD: Final = """# Beyond the catalogue

Made by `uv run python bench/beyond.py` from `bench/beyond.jsonl`, one line per study with its
seed, its truth and its score; `uv run python -m tests.blind.beyond bench/beyond.jsonl` goes on
with them. A generator that shares no code with the analysis hides in raw samples what no cause
of the catalogue has, its parameters drawn anew: eight people of 45 trials each, 1.5 s a trial,
and people, contacts and sensors as in `blind.md`. What is characterised is described in
`discover.md`.

*Flagged*: something is said to be left, or its form is given. *Right*: the form given is of the
family that was hidden. *Within*: the parameter that says where it is lies in its 95 % interval,
of those with the right form. *Gain*: of those given a form, held-out people are predicted
better, with the interval above 0.
"""


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lines", type=Path, default=ROOT / "bench" / "beyond.jsonl")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "beyond.md")
    asked = parser.parse_args()
    asked.out.write_text(page(read(asked.lines)), encoding="utf-8", newline="\n")


def page(lines: Sequence[dict[str, Any]]) -> str:
    """Return the page of a campaign's lines."""
    scored = [line for line in lines if "score" in line]
    hidden = [line for line in scored if line["kind"] != "null"]
    nulls = [line["score"] for line in scored if line["kind"] == "null"]
    rows = [
        _row(kind, [line["score"] for line in hidden if line["kind"] == kind])
        for kind in DESIGNS
        if kind != "null"
    ]
    rows.append(_row("all", [line["score"] for line in hidden]))
    table = [
        "| hidden | studies | flagged | right | within | gain |",
        "|---|---|---|---|---|---|",
        *("| " + " | ".join(row) + " |" for row in rows),
    ]
    named = sum(bool(score["form"]) for score in nulls)
    failed = sum("error" in line for line in lines)
    return "\n".join(
        [
            HEAD,
            *table,
            "",
            f"Of {len(nulls)} studies with nothing hidden, {named} were given a form. "
            f"{failed} studies ended in an error.",
            "",
        ]
    )


def _row(kind: str, scores: Sequence[dict[str, Any]]) -> list[str]:
    right = [score for score in scores if score["right"]]
    given = [score for score in scores if score["form"]]
    covered = [score["covered"] for score in right if "covered" in score]
    return [
        kind.replace("_", " "),
        str(len(scores)),
        _of(sum(score["flagged"] for score in scores), len(scores)),
        _of(len(right), len(scores)),
        _of(sum(covered), len(covered)),
        _of(sum(score["nats"] > 0.0 for score in given), len(given)),
    ]


def _of(hits: int, count: int) -> str:
    return f"{hits} of {count}" if count else "-"


if __name__ == "__main__":
    main()
