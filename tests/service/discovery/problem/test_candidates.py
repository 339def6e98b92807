"""Patterns follow what was measured, and what was asked for."""

import numpy as np
import pytest
from tests.service.discovery.made import made

from frictus_service.discovery.evidence.evidence_rows import subjects_of
from frictus_service.discovery.evidence.observation_table import rows_of, units_of, used
from frictus_service.discovery.problem.candidates import (
    AS_ASKED,
    FORMS,
    Covariate,
    Pattern,
    patterns_of,
)


@pytest.mark.parametrize("covariate", list(AS_ASKED))
def test_the_last_forms_do_not_wander_within_a_condition(
    covariate: Covariate, rng: np.random.Generator
) -> None:
    trials = used(made(rng))
    units = units_of(trials, "friction")
    (subject, *_) = subjects_of(rows_of(trials, units, "friction"), len(units.names))
    every = tuple(range(subject.tone.max() + 1))
    shapes = [
        Pattern("size", every, covariate, form).of(subject).size
        for form in range(FORMS[covariate])
    ]
    targets = np.unique(subject.target_mm_s if covariate == "speed" else subject.target_n)
    for measured, asked in zip(shapes[:2], shapes[2:], strict=True):
        assert np.unique(measured).size > targets.size >= np.unique(asked).size
    assert np.corrcoef(shapes[0], shapes[2])[0, 1] > 0.9
    found = patterns_of(len(every), skin=False)
    assert Pattern("size", every, covariate, FORMS[covariate] - 1) in found
