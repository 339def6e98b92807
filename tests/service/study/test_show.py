"""`frictus study show` says what is in a file, and what is wrong with it."""

import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.cli.studies.study import print_summary
from frictus_service.study.reader import StudyReader
from frictus_service.study.summary import summarise
from frictus_service.study.trial import Trial

MakeTrial = Callable[..., Trial]
WriteStudy = Callable[..., Path]


@pytest.fixture
def study_file(make_trial: MakeTrial, write_study: WriteStudy) -> Path:
    gap = make_trial("gap", order=1, speed_mm_s=20.0, n_samples=2000)
    gap.force_n[3:7] = np.nan
    again = replace(gap, info=replace(gap.info, id="again", participant="p2"))
    return write_study(
        make_trial("plain", order=0),
        gap,
        make_trial("blank", order=2, session=1, tones_hz=(), drive_vpp=0.0, voltage_v=None),
        make_trial("slip", order=3, speed_mm_s=0.06),
        make_trial("in mN", order=4, force_n=np.full((400, 3), 400.0)),
        again,
    )


def shown(*arguments: str) -> tuple[int, dict[str, Any]]:
    done = CliRunner().invoke(app, ["study", "show", *arguments])
    return done.exit_code, json.loads(done.stdout)


def test_the_attributes_are_summed_up_without_the_data(study_file: Path) -> None:
    code, told = shown(str(study_file), "--json")
    assert code == Exit.OK
    assert told["size_bytes"] == study_file.stat().st_size
    assert told["trials"] == 5
    assert told["participants"][0] == {
        "name": "p1",
        "sessions": 2,
        "trials": 4,
        "blanks": 1,
        "duration_s": pytest.approx(0.16),
    }
    assert told["conditions"]["speed_mm_s"] == {"20.0": 2, "60.0": 3}
    assert told["conditions"]["tone_hz"] == {"0.0": 1, "250.0": 4}
    assert [one["trial"] for one in told["excluded"]] == ["slip"]
    assert told["missing"] is None
    assert told["extras"]["lab"] == "nord"


def test_check_reads_the_data_and_fails_where_a_trial_is_bad(study_file: Path) -> None:
    code, told = shown(str(study_file), "--check")
    assert code == Exit.CHECK_FAILED
    assert {one["trial"]: one["field"] for one in told["excluded"]} == {
        "slip": "speed_mm_s",
        "in mN": "force_n",
        "again": "data",
    }
    assert told["trials"] == 3
    assert told["missing"] == {"gap": {"force_n": 4}}


def test_people_see_tables(study_file: Path) -> None:
    page = io.StringIO()
    console = Console(width=100, file=page)
    with StudyReader(study_file) as study:
        for check in (False, True):
            print_summary(study_file, summarise(study, 1_500_000, check=check), console)
    text = page.getvalue()
    assert "5 trials" in text
    assert "1.5 MB" in text
    assert "lab = nord" in text
    assert "20 (2), 60 (3)" in text
    assert "excluded: trial slip, speed_mm_s: is 0.06 mm/s" in text
    assert "--check reads all data" in text
    assert "missing samples: trial gap: 4 in force_n" in text


def test_a_participant_is_no_markup(make_trial: MakeTrial, write_study: WriteStudy) -> None:
    trial = make_trial("t", order=0)
    file = write_study(replace(trial, info=replace(trial.info, participant="[/p]")))
    page = io.StringIO()
    with StudyReader(file) as study:
        print_summary(file, summarise(study, 1_000, check=False), Console(file=page))
    assert "[/p]" in page.getvalue()


@pytest.mark.parametrize("content", [None, b"no study"])
def test_what_is_no_study_ends_in_one_sentence(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "x.h5"
    if content is not None:
        path.write_bytes(content)
    done = CliRunner().invoke(app, ["study", "show", str(path)])
    assert done.exit_code == Exit.USAGE
    assert done.stderr.startswith("frictus: ")
    assert "x.h5" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_broadband_trial_is_no_blank(make_trial: MakeTrial, write_study: WriteStudy) -> None:
    file = write_study(
        make_trial("noise", order=0, tones_hz=()),
        make_trial("blank", order=1, tones_hz=(), drive_vpp=0.0, voltage_v=None),
    )
    _, told = shown(str(file), "--json")
    assert told["participants"][0]["blanks"] == 1
