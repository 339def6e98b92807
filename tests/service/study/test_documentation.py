"""`docs/study.md` does what it says."""

import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from frictus_service.errors import Exclusion
from frictus_service.study.importers import read_all
from frictus_service.study.layout import digest
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import Trial

PAGE = (Path(__file__).parents[3] / "docs" / "study.md").read_text(encoding="utf-8")


def test_the_examples_write_a_study_and_read_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write, read = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(write, {})
    with StudyReader(tmp_path / "mine.h5") as study:
        (trial,) = read_all(study)
    assert isinstance(trial, Trial)
    assert trial.info.tones_hz == (250.0,)
    exec(read, {})
    assert trial.sha256 in capsys.readouterr().out


def test_what_the_matlab_example_stores_is_read(tmp_path: Path) -> None:
    """The example sets every attribute, and MATLAB stores axes in reverse and text as bytes."""
    (code,) = re.findall(r"```matlab\n(.*?)```", PAGE, re.DOTALL)
    path = tmp_path / "mine.h5"
    shapes = {"voltage_v": (40_000, 1), "force_n": (40_000, 3)}
    shapes |= {"position_mm": (120, 2), "position_t_s": (120, 1)}
    with h5py.File(path, "w") as file:
        trial = file.create_group("trials/first")
        for name, shape in shapes.items():
            assert f"put('{name}', " in code
            trial[name] = np.linspace(0.0, 1.9, shape[0])[:, None] * np.ones(shape)
        trial["voltage_v"][...] *= 30.0
        for at, name, value in re.findall(r"h5writeatt\(file, (\S+), '(\w+)', (.+?)\);", code):
            holder = file if at == "'/'" else trial
            text = value.strip("'")
            number = 20_000.0 if text == "fs" else text
            holder.attrs[name] = np.bytes_(text) if "'" in value else np.float64(number)
    with StudyReader(path) as study:
        (found,) = read_all(study)
    assert not isinstance(found, Exclusion), found.reason
    assert found.force_n.shape == (40_000, 3)


def test_the_hash_can_be_made_from_its_description(make_trial: Callable[..., Trial]) -> None:
    trial = make_trial()
    trial.force_n[3] = np.nan
    info = trial.info
    attributes = {
        "participant": info.participant,
        "session": info.session,
        "order": info.order,
        "speed_mm_s": info.speed_mm_s,
        "force_n": info.force_n,
        "tone_hz": list(info.tones_hz),
        "drive_vpp": info.drive_vpp,
        "sample_rate_hz": info.sample_rate_hz,
        "started_utc": info.started_utc,
        "force_skew_s": trial.force_skew_s,
        "voltage_source": "monitor",
        "skin_skew_s": trial.skin_skew_s,
    }
    data = b""
    for name in ("voltage_v", "force_n", "accel_m_s2", "position_mm", "position_t_s"):
        values = getattr(trial, name)
        data += f"{name} {list(values.shape)}\n".encode()
        for value in values.ravel().tolist():
            missing = np.isnan(value)
            data += (
                bytes.fromhex("000000000000f87f") if missing else np.float64(value).tobytes()
            )
    head = json.dumps(attributes, sort_keys=True, separators=(",", ":"))
    whole = f"{head}\n{hashlib.sha256(data).hexdigest()}"
    assert digest(trial) == hashlib.sha256(whole.encode()).hexdigest()
