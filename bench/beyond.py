"""Write the table of the studies beyond the catalogue: `python bench/beyond.py --help`.

The studies themselves: `python -m tests.blind.beyond bench/beyond.jsonl`.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

sys.path.insert(0, str(Path(__file__).parents[1]))  # so that a script finds the tests

from bench.blind import of_rate, table
from tests.blind.beyond import DESIGNS, FORMS, MISTAKEN, SHAPE_OF, SHAPES
from tests.blind.campaign import read
from tests.blind.judgement import Rate

ROOT: Final = Path(__file__).parents[1]
HEAD: Final = """# Beyond the catalogue

Made by `uv run python bench/beyond.py` from `bench/beyond.jsonl`, one line per study with its
seed, its truth and its score; `uv run python -m tests.blind.beyond bench/beyond.jsonl` goes on
with them. A generator that shares no code with the analysis hides in raw samples what no cause
of the catalogue has, its parameters drawn anew: eight people of 45 trials each, 1.5 s a trial,
and people, contacts and sensors as in `blind.md`. What is characterised is described in
`discover.md`.

*Flagged*: something is said to be left, or its form is given. *Right*: the form given is of the
family that was hidden. *Another*: a form of another family is given. *Named*: no form is given,
but the cause of which it is another shape (`family`). *Within*: the parameter that says where
it is lies in its 95 % interval, of those with the right form. *Gain*: of those given a form,
held-out people are predicted better, with the interval above 0. *Kept* is what is asked, by the
count; the interval beside it says how much so many studies can show.
"""
OTHER_SHAPES: Final = """## Stick-slip and the mains

Stick-slip of 0.6 or of 1.0 of its realistic size (`blind.md`), half of it the catalogue's
saw-tooth, half that of a skin that is loaded and breaks loose: how much force that takes falls
with speed, the way until then is that force over the stiffness of the skin, a slip takes 8 ms,
and cycles differ. The mains likewise: neither must be taken for the other. Eight people of 40
trials each, 2 s a trial.
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
    of_kind = {
        kind: [_score(line) for line in scored if line["kind"] == kind] for kind in DESIGNS
    }
    forms = {kind: of_kind[kind] for kind in FORMS}
    forms["all"] = [score for scores in forms.values() for score in scores]
    accused = sum(bool(score["causes"]) for score in of_kind["null"])
    failed = sum("error" in line for line in lines)
    return "\n".join(
        [
            HEAD,
            _table(
                ["studies", "flagged", "right", "another", "named", "within", "gain"],
                {kind: _of_forms(scores) for kind, scores in forms.items()},
            ),
            "",
            f"Of {len(of_kind['null'])} studies with nothing hidden, {accused} were given a "
            f"cause. {failed} studies ended in an error.",
            "",
            table(
                ["all kinds", "count", "share, 95 %", "asked", "kept"],
                list(map(of_rate, _rates(forms["all"], of_kind["null"]))),
            ),
            "",
            OTHER_SHAPES,
            _table(
                ["studies", "it named", "the other named", "something left", "another cause"],
                {kind: _of_shapes(name, of_kind[kind]) for kind, name in SHAPES.items()},
            ),
            "",
        ]
    )


def _table(head: Sequence[str], rows: Mapping[str, Sequence[str]]) -> str:
    lines = [["hidden", *head], ["---"] * (1 + len(head))]
    lines += [[kind.replace("_", " "), *row] for kind, row in rows.items()]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _rates(scores: Sequence[dict[str, Any]], nulls: Sequence[dict[str, Any]]) -> list[Rate]:
    """Return what was measured over all kinds, against what is asked."""
    given = [score for score in scores if score["form"]]
    covered = [score["covered"] for score in scores if score["right"] and "covered" in score]
    named = sum(bool(score["form"]) for score in nulls)
    ahead = sum(score["nats"] > 0.0 for score in given)
    flagged = sum(score["flagged"] for score in scores)
    right = sum(score["right"] for score in scores)
    return [
        Rate("flagged", flagged, len(scores), least=0.98),
        Rate("form right", right, len(scores), least=0.80),
        Rate("parameter within its interval", sum(covered), len(covered), 0.90, 0.98),
        Rate("held-out people predicted better", ahead, len(given), least=0.95),
        Rate("nothing hidden, and a form given", named, len(nulls), most=0.02),
    ]


def _score(line: dict[str, Any]) -> dict[str, Any]:
    """Return a score, and whether only the cause is named of which the hidden is a shape."""
    score: dict[str, Any] = line["score"]
    cause = SHAPE_OF.get(line["kind"], "")
    return score | {"named": not score["form"] and score["causes"].get(cause) == "family"}


def _of_forms(scores: Sequence[dict[str, Any]]) -> list[str]:
    right = [score for score in scores if score["right"]]
    given = [score for score in scores if score["form"]]
    covered = [score["covered"] for score in right if "covered" in score]
    return [
        str(len(scores)),
        _share(sum(score["flagged"] for score in scores), len(scores)),
        _share(len(right), len(scores)),
        _share(len(given) - len(right), len(scores)),
        _share(sum(score["named"] for score in scores), len(scores)),
        _share(sum(covered), len(covered)),
        _share(sum(score["nats"] > 0.0 for score in given), len(given)),
    ]


def _of_shapes(name: str, scores: Sequence[dict[str, Any]]) -> list[str]:
    others = set(SHAPES.values()) - {name}
    return [
        str(len(scores)),
        _share(sum(name in score["causes"] for score in scores), len(scores)),
        _share(sum(bool(others & set(score["causes"])) for score in scores), len(scores)),
        _share(sum(bool(score["left"]) for score in scores), len(scores)),
        _share(sum(bool(set(score["causes"]) - MISTAKEN) for score in scores), len(scores)),
    ]


def _share(hits: int, count: int) -> str:
    return f"{hits} of {count}" if count else "-"


if __name__ == "__main__":
    main()
