"""From studies to the document: what is used, left out, kept, and said."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from tests.service.discovery.made import MOUNT, Design, facts, made

from frictus_hardware.physics.linear import TransferFunction
from frictus_service.discovery.across_studies import page, study_work
from frictus_service.discovery.across_studies.across import discover_across, names_of
from frictus_service.discovery.across_studies.document import AcrossStudies
from frictus_service.discovery.document import StudyFacts
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.errors import StudyError

DESIGN = Design(6, (20.0, 100.0), (0.4,), repeats=1)
SHARE = 0.1
Read = Callable[[], list[str]]


@pytest.fixture
def laboratories(
    tmp_path: Path, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> tuple[list[Path], list[str]]:
    """Four studies, one of them a copy, and one that is no study; and what has been read.

    Their evidence is drawn as trials would give it: raw samples are in `test_whole_across`.
    """
    delays = {"a": 0.0, "b": 20e-6, "c": 0.0}
    evidence = {
        name: made(
            rng,
            [("direction_asymmetry", {"share": SHARE}), ("channel_delay", {"delay_s": delay})],
            DESIGN,
        )
        for name, delay in delays.items()
    }
    evidence["copy"] = evidence["b"]
    read: list[str] = []

    def facts_of(path: Path) -> tuple[StudyFacts, TransferFunction | None]:
        if path.stem not in evidence:
            raise StudyError(f"{path} is no study")
        found = facts(evidence[path.stem]).model_copy(update={"sha256": path.stem})
        return found, MOUNT

    def study_evidence(path: Path, **_: object) -> Sequence[TrialEvidence]:
        read.append(path.stem)
        return evidence[path.stem]

    monkeypatch.setattr(study_work, "facts_of", facts_of)
    monkeypatch.setattr(study_work, "study_evidence", study_evidence)
    return [tmp_path / f"{name}.h5" for name in (*evidence, "bad")], read


@pytest.mark.long
def test_what_is_used_left_out_kept_and_said(
    laboratories: tuple[list[Path], list[str]], tmp_path: Path
) -> None:
    paths, read = laboratories
    told: list[str] = []
    found = discover_across(paths, tmp_path / "out", workers=0, tell=told.append)
    assert [each.name for each in found.studies] == ["a", "b", "c"]
    assert [Path(each.path).stem for each in found.left_out] == ["copy", "bad"]
    copy, bad = (each.reason for each in found.left_out)
    assert copy == "24 of its 24 trials are those of b: studies must not share data"
    assert bad.endswith("bad.h5 is no study")
    assert any("bad is left out" in line for line in told)
    assert "2 of 5 studies are left out; reasons below." in found.notes

    causes = {each.id: each for each in found.causes}
    delay = causes["channel_delay"]
    assert delay.in_model
    assert delay.scope == "instrument"
    assert delay.sizes == "in_some_only"
    sizes = {each.study: each.value for each in delay.studies}
    assert sizes["b"] == pytest.approx(20e-6, abs=2e-6)
    assert max(abs(sizes[name]) for name in "ac") < 2e-6
    asymmetry = causes["direction_asymmetry"]
    assert all(each.value == pytest.approx(SHARE, abs=0.03) for each in asymmetry.studies)
    for study in found.studies:
        assert (tmp_path / "out" / study.report).is_file()

    # Broken off and begun again, it reads no study anew, and gives the same.
    assert sorted(set(read)) == ["a", "b", "c", "copy"]
    before = len(read)
    again = discover_across(paths, tmp_path / "out", workers=0)
    assert len(read) == before
    assert again == found

    written = page.write(found, tmp_path / "out")
    text = written[1].read_bytes()
    assert AcrossStudies.model_validate_json(text) == found
    assert json.loads(text)["schema"] == "across-studies/1"
    html = written[0].read_text("utf-8")
    assert found.sentence in html
    assert html.count("forest plot of") == 2 + sum(each.in_model for each in found.causes)
    assert bad.rpartition("/")[2] in html


@pytest.mark.long
def test_a_damaged_result_is_made_again(
    laboratories: tuple[list[Path], list[str]], tmp_path: Path
) -> None:
    paths, read = laboratories
    task_results = tmp_path / "out" / "results"
    with pytest.raises(StudyError, match=r"1 of 2 studies can be used; needed: 2.*no study"):
        discover_across([paths[0], paths[-1]], tmp_path / "out", workers=0)
    assert read == ["a"]
    (statistics,) = task_results.glob("*.statistics")
    statistics.write_bytes(statistics.read_bytes()[:-1])
    with pytest.raises(StudyError):
        discover_across([paths[0], paths[-1]], tmp_path / "out", workers=0)
    assert read == ["a", "a"]


def test_one_study_under_many_names_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with pytest.raises(StudyError, match="3 names are of one and the same study"):
        discover_across([path, tmp_path / "." / "a.h5", path], tmp_path / "out", workers=0)
    assert not (tmp_path / "out").exists()


def test_names_are_paths_from_where_they_part() -> None:
    names = names_of([Path("/d/lab1/s.h5"), Path("/d/lab2/s.h5"), Path("/d/t.h5")])
    assert names == ["lab1/s", "lab2/s", "t"]
    assert names_of([Path("/d/a.h5"), Path("/d/b.h5")]) == ["a", "b"]
