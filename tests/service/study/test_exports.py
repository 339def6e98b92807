"""What other programs read in an export is what the study holds."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.io import loadmat

from frictus_service.errors import Exclusion, StudyError
from frictus_service.study.export import export_matlab, export_parquet
from frictus_service.study.importers import Study
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import Trial

MakeTrial = Callable[..., Trial]
WriteStudy = Callable[..., Path]
Export = Callable[[Study, Path], tuple[Exclusion, ...]]
DATA = ("voltage_v", "force_n", "accel_m_s2", "skin_velocity_m_s", "position_mm")


@pytest.fixture
def study_file(
    make_trial: MakeTrial, write_study: WriteStudy, rng: np.random.Generator
) -> Path:
    gap = make_trial("gap", order=1)
    gap.force_n[3:7] = np.nan
    return write_study(
        make_trial("plain", order=0),
        gap,
        make_trial("blank", order=2, tones_hz=(), drive_vpp=0.0, voltage_v=None),
        make_trial(
            "Zoë", order=3, accel_m_s2=None, skin_velocity_m_s=rng.normal(0.0, 0.1, 400)
        ),
        make_trial("chord", order=4, tones_hz=(70.0, 130.0), n_samples=3000),
        make_trial("in mN", order=5, force_n=np.full((400, 3), 400.0)),
        make_trial("slow", order=6, speed_mm_s=0.06),
    )


def test_matlab_files_hold_the_study(study_file: Path, tmp_path: Path) -> None:
    with StudyReader(study_file) as study:
        excluded = export_matlab(study, tmp_path / "out")
        assert {one.trial for one in excluded} == {"in mN", "slow"}
        index: dict[str, Any] = loadmat(tmp_path / "out" / "study.mat", simplify_cells=True)
        assert index["rig"] == study.info.rig
        assert index["sha256"] == study.sha256
        assert json.loads(index["extras"]) == study.info.extras
        assert len(json.loads(index["mount"])["lateral"]["denominator"]) == 5
        assert {one["trial"] for one in index["excluded"]} == {"in mN", "slow"}
        assert len(index["trials"]) == 5
        for row in index["trials"]:
            trial = study.read(row["id"])
            assert np.atleast_1d(row["tone_hz"]).tolist() == list(trial.info.tones_hz)
            assert row["target_force_n"] == trial.info.force_n
            assert (row["session"], row["order"]) == (trial.info.session, trial.info.order)
            assert row["sha256"] == trial.sha256
            held = loadmat(tmp_path / "out" / row["file"])
            assert held["id"][0] == trial.info.id
            assert held["force_skew_s"][0, 0] == trial.force_skew_s
            for name in (*DATA, "position_t_s"):
                values = getattr(trial, name)
                expected = np.zeros((0, 0)) if values is None else values
                if expected.ndim == 1:
                    expected = expected[:, None]
                np.testing.assert_array_equal(held[name], expected, err_msg=name)


def test_parquet_tables_hold_the_study(study_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with StudyReader(study_file) as study:
        excluded = export_parquet(study, out)
        assert {one.trial for one in excluded} == {"in mN", "slow"}
        rows = pq.read_table(out / "trials.parquet").to_pylist()
        assert pq.read_table(out / "excluded.parquet")["trial"].to_pylist() == [
            one.trial for one in excluded
        ]
        root = json.loads(pq.read_schema(out / "trials.parquet").metadata[b"study"])
        assert root["extras"] == study.info.extras
        assert pq.ParquetFile(out / "samples.parquet").num_row_groups == len(rows) == 5
        for row in rows:
            trial = study.read(row["id"])
            assert tuple(row["tone_hz"]) == trial.info.tones_hz
            assert row["sha256"] == trial.sha256
            chosen = [("trial", "==", row["id"])]
            samples = pq.read_table(out / "samples.parquet", filters=chosen)
            places = pq.read_table(out / "positions.parquet", filters=chosen)
            assert samples["row"].to_pylist() == list(range(len(trial.force_n)))
            for axis, name in enumerate(("force_x_n", "force_y_n", "force_z_n")):
                np.testing.assert_array_equal(samples[name].to_numpy(), trial.force_n[:, axis])
            for name in ("voltage_v", "skin_velocity_m_s"):
                values = getattr(trial, name)
                if values is None:
                    assert samples[name].null_count == len(trial.force_n)
                else:
                    np.testing.assert_array_equal(samples[name].to_numpy(), values)
            np.testing.assert_array_equal(places["t_s"].to_numpy(), trial.position_t_s)
            np.testing.assert_array_equal(places["y_mm"].to_numpy(), trial.position_mm[:, 1])


@pytest.mark.parametrize("export", [export_matlab, export_parquet])
def test_an_export_appears_whole_or_not_at_all(
    export: Export, study_file: Path, tmp_path: Path
) -> None:
    (tmp_path / "taken").mkdir()
    with StudyReader(study_file) as study:
        with pytest.raises(StudyError, match="exists"):
            export(study, tmp_path / "taken")
        assert study.trials
    with pytest.raises(StudyError, match="was closed"):
        export(study, tmp_path / "out")
    assert {path.name for path in tmp_path.iterdir()} == {"taken", study_file.name}
