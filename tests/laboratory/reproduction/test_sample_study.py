"""The sample study of the stage: what is hidden in it is found."""

from pathlib import Path

import numpy as np
import pytest

from frictus_laboratory.reproduction import sample_study
from frictus_laboratory.reproduction.sample_study import HIDDEN, VARIES, write_sample_study
from frictus_service.discovery.discover import discover_study


@pytest.mark.long
@pytest.mark.parametrize("hidden", HIDDEN, ids=[effect for effect, _, _ in HIDDEN])
def test_each_of_the_effects_is_named_with_its_size(
    hidden: tuple[str, str, float],
    tmp_path: Path,
    rng: np.random.Generator,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sample_study, "HIDDEN", (hidden,))
    path = tmp_path / "study.h5"
    ((effect, parameters),) = write_sample_study(path, rng)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["study.h5"]
    found = discover_study(path, workers=0, seed=1)
    assert [(cause.id, cause.verdict) for cause in found.causes] == [(effect, "confirmed")]
    name, middle = hidden[1:]
    assert VARIES[0] <= parameters[name] / middle <= VARIES[1]
    assert found.causes[0].parameters[name].value == pytest.approx(parameters[name], rel=0.15)
