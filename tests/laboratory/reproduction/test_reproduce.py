"""The whole way at a small size: people, file, pipeline, table."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from frictus_laboratory.reproduction.paper import HEADINGS, Row, markdown
from frictus_laboratory.reproduction.plan import StudyConditions
from frictus_laboratory.reproduction.reproduce import Reproduction, reproduce
from frictus_service.errors import StudyError

TINY = StudyConditions(
    (40.0, 100.0, 220.0, 450.0, 700.0, 2000.0),
    speeds_mm_s=(30.0, 90.0),
    forces_n=(0.3, 0.5),
    seconds=1.2,
    delay_s=1e-4,
)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory, module_seed: int) -> Reproduction:
    folder = tmp_path_factory.mktemp("paper")
    return reproduce(folder / "study.h5", TINY, 2, module_seed, 0, lambda _: None)


def test_every_value_of_the_paper_has_a_row(found: Reproduction) -> None:
    rows = {row.quantity: row for row in found.rows}
    assert rows["gain"].drawn == pytest.approx(0.39)
    assert rows["cutoff, extrapolated to 0 mm/s"].drawn == pytest.approx(385.68)
    assert rows["cutoff, speed law"].drawn == pytest.approx(13.811)
    assert rows["mass: speed"].drawn == pytest.approx(3.5e-5)
    assert rows["mass: speed"].paper == "3.5e-05 (3.23e-05)"
    assert rows["stiffness: speed"].drawn == pytest.approx(4.036)
    assert rows["delay"].drawn == 1e-4
    for name in ("gain", "cutoff", "mass", "damping", "stiffness"):
        for effect in ("force", "interaction"):
            assert rows[f"{name}: {effect}"].drawn == 0.0
            assert rows[f"{name}: {effect}"].paper == "no effect"
    assert rows["damping: speed"].drawn == 0.0
    assert rows["cutoff and stiffness, pooled"].ci95 is None


def test_what_comes_out_is_near_what_went_in(found: Reproduction) -> None:
    rows = {row.quantity: row for row in found.rows}
    for name, share in (("gain", 0.2), ("cutoff, speed law", 0.25), ("damping", 0.3)):
        assert rows[name].estimate == pytest.approx(rows[name].drawn, rel=share)
    assert rows["delay"].estimate == pytest.approx(1e-4, abs=1e-5)
    assert found.identification.study.trials == 2 * 24
    assert len(found.identification.study.sha256) == 64


def test_table_has_a_line_per_row_and_fields_are_json(found: Reproduction) -> None:
    lines = markdown(found.rows).splitlines()
    assert len(lines) == 2 + len(found.rows)
    assert all(line.count("|") == len(HEADINGS) + 1 for line in lines)
    json.dumps([row.fields() for row in found.rows], allow_nan=False)


def test_existing_study_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "study.h5"
    path.write_bytes(b"something")
    with pytest.raises(StudyError, match="exists"):
        reproduce(path, TINY, 2, 0, 0, lambda _: None)


def test_verdicts_are_compared_at_five_percent() -> None:
    row = Row("gain", "N", "0.39", 0.39, 0.4, (0.38, 0.42), 0.04, 0.4)
    assert row.covers is True
    assert row.agrees is False
    assert replace(row, paper_p=0.01).agrees is True
    assert replace(row, p_value=None).agrees is None
    assert replace(row, ci95=(0.395, 0.42)).covers is False
    assert replace(row, ci95=None).covers is None
