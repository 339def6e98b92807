"""Write how the finger is followed while it plays: `python bench/tracking.py --help`.

The campaign itself is `python -m tests.campaigns.live_model bench/live_model.jsonl`; this reads
its lines.
"""

import argparse
import sys
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parents[1]))  # so that a script finds the tests

from bench import live_model_tables as tables
from bench import live_model_verdicts as verdicts
from tests.campaigns import live_model
from tests.campaigns.lines import read

from frictus_laboratory.live_model.disturbances import FAULTS

ROOT: Final = Path(__file__).parents[1]
LINES: Final = ROOT / "bench" / "live_model.jsonl"
OUT: Final = ROOT / "docs" / "live_model.md"


def main() -> None:
    """Write the document from the lines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lines", type=Path, default=LINES)
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    lines = tables.counted(read(given.lines))
    template = (ROOT / "bench" / "live_model.md").read_text(encoding="utf-8")
    text = template.format(
        sources=tables.sources(lines),
        learned=tables.learned(lines),
        coverage=tables.coverage(lines),
        nulls=tables.nulls(lines),
        drifts=tables.drifts(lines),
        followed=tables.followed(lines),
        turns=tables.turns(lines),
        causes=tables.causes(lines),
        rig=tables.harm(lines, "rig", live_model.RIG),
        faults=tables.harm(lines, "fault", FAULTS),
        cost=tables.cost(lines),
        learned_verdict=verdicts.learned(lines),
        coverage_verdict=verdicts.coverage(lines),
        nulls_verdict=verdicts.nulls(lines),
        followed_verdict=verdicts.followed(lines),
        rig_verdict=verdicts.rig(lines),
        faults_verdict=verdicts.faults(lines),
        sessions=len(lines),
        factors=", ".join(live_model.FACTORS),
    )
    given.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
