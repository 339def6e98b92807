"""Studies with everything of the catalogue hidden in them are left in peace; slips are named.

`uv run pytest -n 0 -s -m campaign tests/service/identification/plausibility` prints the figures
of `docs/study.md`.
"""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from tests.blind.cases import REALISTIC, UNKNOWN, cause, draw_case
from tests.blind.generator import Case, Design, Seeds, make_study
from tests.service.identification.plausibility.slips import (
    SLIPS,
    WARNINGS,
    is_refused,
    record_of,
)

from frictus_service.identification.plausibility.judge import judge_study
from frictus_service.study.importers import open_study
from frictus_service.study.trial import StudyInfo, Trial

STUDIES = 30
SLIPPED_TRIALS = 10
"""Of each study, so that a slip is found in little data."""


def case_of(number: int, rng: np.random.Generator) -> Case:
    """Return a study with all causes hidden in it, or every third with an unknown one."""
    design = Design(participants=1, n_speeds=2, n_forces=2)
    if number % 3 == 2:
        hidden = draw_case("unknown", UNKNOWN[number // 3 % len(UNKNOWN)], rng).hidden
    else:
        hidden = tuple(cause(name, 1.0 + number % 3, rng) for name in sorted(REALISTIC))
    return Case("plausible", hidden, design)


def trials_of(path: Path) -> tuple[list[Trial], StudyInfo]:
    with open_study(path) as study:
        return [study.read(each.id) for each in study.trials], study.info


@pytest.mark.campaign
@pytest.mark.timeout(3600)
def test_no_false_alarm_and_every_slip_named(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    alarms: list[str] = []
    named: Counter[str] = Counter()
    for number in range(STUDIES):
        path = tmp_path / f"{number}.h5"
        seeds = Seeds(*(int(each) for each in rng.integers(2**31, size=2)))
        make_study(path, case_of(number, rng), seeds)
        trials, info = trials_of(path)
        path.unlink()
        alarms += [each.text for each in judge_study([record_of(t, info) for t in trials])]
        few = [trials[k] for k in rng.permutation(len(trials))[:SLIPPED_TRIALS]]
        for name, slip in {**SLIPS, **WARNINGS}.items():
            made = [slip.make(each) for each in few]
            kept = [record_of(each, info) for each in made if not is_refused(each, info)]
            found = {each.code for each in judge_study(kept)}
            named[name] += bool(found & slip.found_by) or 2 * len(kept) < len(few)
    for name in (*SLIPS, *WARNINGS):
        print(f"| {name} | {named[name]} of {STUDIES} |")  # noqa: T201
    print(f"| right studies with any finding | {len(alarms)} of {STUDIES} |", alarms)  # noqa: T201
    assert len(alarms) <= 1
    assert all(named[name] == STUDIES for name in SLIPS)
    assert all(named[name] >= 0.9 * STUDIES for name in WARNINGS)
