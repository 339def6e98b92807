"""Real recordings through the door: what they lack is said, what they have is looked at."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.study.trial import read_mount

SHARED = Path(__file__).parents[4] / "shared" / "data"
FABRIC, BLOWS = SHARED / "fabricslide", SHARED / "mount_impacts" / "lateral_data.mat"
MAP = """
schema = "column_map/1"
[channels.time]
column = "timestamp"
unit = "ms"
[channels.force_z]
column = "channel6"
unit = "counts"
"""


def run(*words: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, [str(word) for word in words])
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.skipif(not FABRIC.exists(), reason="shared recordings are not on this machine")
def test_fabricslide(tmp_path: Path) -> None:
    files = sorted(FABRIC.glob("Linen*.csv"))
    (tmp_path / "fabric.toml").write_text(MAP)
    code, _, told = run("study", "import", files[0], tmp_path / "a.h5", "--yes")
    assert code == 2
    assert "35.7 Hz is too slow" in told
    assert "frictus study show --friction" in told
    by_map = ["--map", tmp_path / "fabric.toml", "--set", "stage_speed_mm_s=100"]
    code, _, told = run("study", "import", files[0], tmp_path / "a.h5", *by_map)
    assert code == 2
    for lack in ("too slow for the band", "raw counts", "no tangential force is mapped"):
        assert lack in told
    code, told, _ = run("study", "show", "--friction", *files, *by_map[:2], "--json")
    assert code == 0
    found = json.loads(told)
    assert found["slides"] == len(files)
    assert found["coefficient"] is None
    speeds = [each["speed_mm_s"] for each in found["spectra"]]
    assert speeds == pytest.approx([10.0, 20.0, 50.0, 100.0, 120.0, 150.0], rel=0.01)


@pytest.mark.skipif(not BLOWS.exists(), reason="shared recordings are not on this machine")
def test_blows_on_a_mount(tmp_path: Path) -> None:
    code, _, told = run("study", "import", BLOWS, tmp_path / "a.h5", "--yes")
    assert code == 2
    assert "hammer blows are for frictus mount" in told
    code, told, _ = run("mount", BLOWS, "--out", tmp_path / "mount.json", "--json")
    assert code == 0
    lateral = read_mount(tmp_path / "mount.json")
    assert lateral is not None
    assert lateral.numerator[-1] == lateral.denominator[-1]
    strongest = max(json.loads(told)["resonances"], key=lambda each: each["level_db"])
    assert lateral.denominator[-1] ** 0.5 / 6.283185307 == pytest.approx(
        strongest["frequency_hz"], rel=1e-6
    )
