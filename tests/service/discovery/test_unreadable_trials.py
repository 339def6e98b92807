"""Trials that cannot be read are counted, with the reason."""

from pathlib import Path

import h5py
import numpy as np
from tests.service.discovery.made import MOUNT, made

from frictus_service.discovery.discover import discover, facts_of
from frictus_service.discovery.problem.base_models import base_model

WHOLE = {
    "participant": "p01",
    "session": 0,
    "speed_mm_s": 60.0,
    "force_n": 0.4,
    "tone_hz": 100.0,
    "drive_vpp": 150.0,
    "sample_rate_hz": 2000.0,
    "started_utc": "2026-03-01T10:00:00Z",
}


def test_a_trial_that_lacks_a_channel_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "study.h5"
    with h5py.File(path, "w") as file:
        file.attrs.update(schema="study/1", rig="r", carrier_hz=700.0, screen_peak_v=75.0)
        for order, channels in enumerate((("voltage_v", "force_n"), ("voltage_v",))):
            trial = file.create_group(f"trials/{order}")
            trial.attrs.update(WHOLE, order=order)
            for name in channels:
                trial[name] = np.ones((2000, 3) if name == "force_n" else 2000)
            trial["position_mm"] = np.ones((2, 2))
            trial["position_t_s"] = np.array([0.0, 0.9])
    facts, _ = facts_of(path)
    assert (facts.trials, facts.simulated) == (2, False)
    assert [(one.reason.split(":")[0], one.trials) for one in facts.left_out] == [
        ("force_n", 1)
    ]


def test_it_is_in_the_report_beside_what_is_not_used(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    path = tmp_path / "study.h5"
    with h5py.File(path, "w") as file:
        file.attrs.update(schema="study/1", rig="r", carrier_hz=700.0, screen_peak_v=75.0)
        file.attrs["simulated"] = 1
        file.create_group("trials/0")
    facts, _ = facts_of(path)
    assert facts.simulated
    evidence = made(rng)[:3]  # too few to be tested
    found = discover(evidence, facts, MOUNT, base_model("paper", "friction"))
    assert found.verdict is None
    assert "1 of 1 trials cannot be read: " in found.notes[0]
    assert sum(one.trials for one in found.study.left_out) == 1 + len(evidence)
