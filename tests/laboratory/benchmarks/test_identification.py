"""The obvious pipeline and ours read the same study; how fast, no test judges."""

from pathlib import Path

import numpy as np

from frictus_laboratory.benchmarks import identification
from frictus_laboratory.benchmarks.identification import rates, write_study


def test_rates_of_a_small_study(tmp_path: Path) -> None:
    path = tmp_path / "study.h5"
    write_study(path, 9, 3.0)
    rate, size = rates(path, 9, repeats=1)
    assert rate.name == "identification_rate"
    assert set(rate.beside) == {"obvious", "reading alone"}
    assert rate.met is not None
    assert size.beside["bare read"] > size.value["pipeline"] > 0.0


def test_the_obvious_pipeline_does_what_it_is_timed_for(tmp_path: Path) -> None:
    path = tmp_path / "study.h5"
    write_study(path, 8, 4.0)
    found = identification.cutoffs_hz(path)
    assert set(found) == {(40.0, 0.4), (80.0, 0.4)}
    assert np.isfinite(list(found.values())).all()
