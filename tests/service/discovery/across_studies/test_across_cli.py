"""`frictus discover` of several studies: which are meant, and what cannot be."""

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.cli.studies.across import folder_of, studies_of


def run(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["discover", *words])
    return result.exit_code, result.stderr


def test_files_and_folders_one_level_down(tmp_path: Path) -> None:
    visits = [tmp_path / "labs" / name for name in ("b.h5", "lab1/visit1.h5", "lab1/visit2.h5")]
    for visit in visits:
        visit.parent.mkdir(parents=True, exist_ok=True)
        visit.touch()
    alone = tmp_path / "alone.h5"
    assert studies_of([alone]) == [alone]  # what it is, says whoever opens it
    assert sorted(studies_of([tmp_path / "labs", alone])) == sorted([*visits, alone])
    empty = tmp_path / "empty"
    empty.mkdir()
    assert studies_of([empty]) == [empty]  # an importer may know what it is
    with pytest.raises(
        typer.BadParameter, match=r"no study in this folder; accepted:.*NAME.h5"
    ):
        studies_of([alone, empty])


def test_results_lie_beside_a_folder_of_studies(tmp_path: Path) -> None:
    assert folder_of([tmp_path / "labs"]) == tmp_path.resolve() / "labs-discovery"
    assert folder_of([tmp_path / "a.h5", tmp_path / "b.h5"]) == Path("across-studies")


def test_what_cannot_be_used_is_a_sentence_and_a_code(tmp_path: Path) -> None:
    for name in "ab":
        (tmp_path / f"{name}.h5").write_bytes(b"no study")
    out = ("--out", str(tmp_path / "out"), "--workers", "0")
    code, told = run(str(tmp_path), *out)
    assert code == 2
    last = told.splitlines()[-1]
    assert last.startswith("frictus: 0 of 2 studies can be used; needed: 2 or more. ")
    assert last.count("is not an HDF5 file") == 2
    assert not (tmp_path / "out" / "report.html").exists()
    code, told = run(str(tmp_path), *out, "--draft-cause", "tape_resonance")
    assert code == 2
    assert "one study" in told
