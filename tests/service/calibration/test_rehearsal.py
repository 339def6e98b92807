"""What judges trials is compiled before the first: the first itself compiles nothing more."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from tests.service.calibration.test_trial_capture import INFO

from frictus_hardware.physics.linear import Mount
from frictus_service.calibration.rehearsal import rehearse
from frictus_service.study.trial import StudyInfo

STUDY = StudyInfo(rig="rig1", mount=Mount().lateral)
A_TRIAL_AFTER_IT = """
import sys
import numba.core.dispatcher
import numpy as np
from tests.service.calibration.test_rehearsal import STUDY
from tests.service.calibration.test_trial_capture import INFO, filled
from frictus_service.calibration.rehearsal import rehearse
from frictus_service.identification.observation.observe import observe

def compiled():
    "Return the kernels with how many signatures each has, read from the cache or compiled."
    return {
        f"{name}.{key}": len(found.signatures)
        for name, module in list(sys.modules.items()) if name.startswith("frictus")
        for key, found in vars(module).items()
        if isinstance(found, numba.core.dispatcher.Dispatcher) and found.signatures
    }

assert not compiled()
rehearse(INFO, STUDY)
before = compiled()
assert {name.rpartition(".")[2] for name in before} >= {"solve", "_sum", "_ends"}, before
observe(filled(np.random.default_rng(0), {"force": 1}).trial(INFO), STUDY)
assert compiled() == before, (before, compiled())
"""


@pytest.mark.parametrize("tones_hz", [(100.0,), (70.0, 250.0, 600.0)])
def test_it_goes_through_all_of_the_judgement(tones_hz: tuple[float, ...]) -> None:
    observed = rehearse(replace(INFO, tones_hz=tones_hz), STUDY)
    rows = observed.rows
    assert set(rows.direction) == {-1, 1}
    assert np.isfinite(rows.friction_variance).all()
    assert np.isfinite(rows.mobility).all()
    assert rows.tone_hz.size == 9 * len(tones_hz)


def test_a_trial_after_it_compiles_nothing() -> None:
    subprocess.run([sys.executable, "-c", A_TRIAL_AFTER_IT], check=True, timeout=300.0)
