"""Other layouts: recognised by importers, this package's or another's."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from frictus_service.errors import StudyError
from frictus_service.study.importers import FabricSlide, importers, open_study, sample_rate_hz
from frictus_service.study.trial import Trial

ROOT = Path(__file__).parents[3]
FABRICSLIDE = ROOT.parent / "shared" / "data" / "fabricslide"
HEADER = "timestamp, proximity1, proximity2, channel1\n"
NAME = "Linen_F150_V-100mmps_0.csv"
PLUGIN = """
from pathlib import Path
from frictus_service.study.reader import StudyReader

class Zipped:
    layout = "renamed"
    def recognises(self, path):
        return path.suffix == ".labfile"
    def open(self, path):
        return StudyReader(path)

importer = Zipped()
"""


@pytest.mark.skipif(not FABRICSLIDE.exists(), reason=f"{FABRICSLIDE} is not there")
def test_recordings_that_cannot_be_identified_are_refused_with_reasons() -> None:
    for path in (FABRICSLIDE, *FABRICSLIDE.glob("*.csv")):
        with pytest.raises(StudyError, match="no tangential force") as refused:
            open_study(path)
        assert "35.7 Hz is too slow for the band of 20 to 1000 Hz" in str(refused.value)
        assert str(refused.value).startswith(f"{path}: ")
    with pytest.raises(StudyError, match="12 FabricSlide recordings cannot"):
        open_study(FABRICSLIDE)


def test_a_recording_in_place_of_a_study_is_told_how_it_becomes_one(tmp_path: Path) -> None:
    path = tmp_path / "pilot.mcap"
    path.write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(StudyError, match=r"frictus export .*pilot\.mcap --to h5 makes one"):
        open_study(path)


def test_fabricslide_is_known_by_name_and_columns(tmp_path: Path) -> None:
    importer = FabricSlide()
    (tmp_path / NAME).write_text(HEADER + "".join(f"{28 * n},1,2,3\n" for n in range(9)))
    (tmp_path / "notes.csv").write_text(HEADER)
    (tmp_path / "x_F1_V2mmps_0.csv").write_text("t,x\n0,1\n")
    (tmp_path / "y_F1_V2mmps_0.csv").write_bytes(b"\xff\xfe\x00")
    assert importer.recognises(tmp_path)
    assert importer.recognises(tmp_path / NAME)
    assert not importer.recognises(tmp_path / "notes.csv")
    assert not importer.recognises(tmp_path / "x_F1_V2mmps_0.csv")
    assert not importer.recognises(tmp_path / "y_F1_V2mmps_0.csv")
    assert sample_rate_hz(tmp_path / NAME) == pytest.approx(1000.0 / 28.0)
    with pytest.raises(StudyError, match="1 FabricSlide recording cannot"):
        importer.open(tmp_path)


@pytest.mark.parametrize("rows", ["", "x,1,2,3\n", "1,2,3\n1,2,3\n\n", "5,1,2,3\n"])
def test_a_damaged_fabricslide_file_is_named(rows: str, tmp_path: Path) -> None:
    (tmp_path / NAME).write_text(HEADER + rows)
    with pytest.raises(StudyError, match="timestamps cannot be read"):
        open_study(tmp_path / NAME)


def register(folder: Path, name: str, code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a package that registers an importer, as pip leaves it behind."""
    (folder / f"{name}.py").write_text(code)
    installed = folder / f"{name}-1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (installed / "entry_points.txt").write_text(
        f"[frictus.importers]\n{name} = {name}:importer\n"
    )
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, name, raising=False)


def test_another_package_registers_an_importer(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    make_trial: Callable[..., Trial],
    write_study: Callable[..., Path],
) -> None:
    register(tmp_path, "labformat", PLUGIN, monkeypatch)
    path = write_study(make_trial("one"), name="study.labfile")
    assert "renamed" in [importer.layout for importer in importers()]
    with open_study(path) as study:
        assert [info.id for info in study.trials] == ["one"]


def test_an_importer_that_does_not_load_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    register(tmp_path, "brokenformat", "import nothing_of_this_name\n", monkeypatch)
    (tmp_path / "file").write_bytes(b"x")
    with pytest.raises(StudyError, match=r"importer brokenformat .* does not load"):
        open_study(tmp_path / "file")
