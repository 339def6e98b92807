"""Each wrong map ends in a sentence that names the entry and what is accepted."""

from pathlib import Path

import numpy as np
import pytest
from tests.service.data_import.conftest import write_csv
from tests.service.data_import.made import Swipes
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.cli.studies import study_import
from frictus_service.data_import.column_map import changed, load_map, map_beside
from frictus_service.data_import.sampling import on_grid
from frictus_service.errors import StudyError

WRONG = {
    "force_x.column=Ft": "force_x: there is no column 'Ft'; columns: 'time [s]'",
    "force_x.unit=V": "channels.force_x: its unit is 'V'; accepted: N, mN",
    "force_x.unit=furlong": "channels.force_x: its unit is 'furlong'; accepted: N, mN",
    "force_x.unit=N": "N; accepted: 0 to 50 N; it looks like mN",  # mN taken for N
    "force_x.unit=counts": "some forces are counts, others not",
    "force_x.sign=2": "force_x.sign: Input should be 1 or -1",
    "force_x.scale=0": "force_x.scale: Input should be greater than",
    "force_x.scale=1e-320": "force_x.scale: Input should be greater than",
    "rate_hz=1e-300": "rate_hz: Input should be greater than",
    "force_x.scale=nan": "force_x.scale",
    "force_x.rate_hz=10000": "force_y: has 20000 Hz, the force 10000 Hz; accepted: the same",
    "drive_voltage.unit=kV": "drive_vpp: is 149925 V; accepted: 1 to 180 V; it looks like mV",
    "drive_voltage.rate_hz=7000": "drive_voltage: lasts",
    "position_x.unit=m": "speed_mm_s: is 7",
    "position_x.unit=um": "no stroke is found",
    "time.unit=ms": "rate_hz: 2e+07 Hz is absurd; correct rate_hz or time.unit",
    "time.column=x [mm]": "time: ",
    "rate_hz=1000": "time: steps at 20000 Hz, but rate_hz is 1000; correct its unit",
    "rate_hz=-5": "rate_hz: Input should be greater than 0",
    "skin_velocity.unit=m/s": "channels.skin_velocity.column: Field required",
    "drive_fraction.column=U [V]": "channels.drive_fraction",
    "friction.column=Fx [mN]": "there is no channel friction; accepted: time, force_x",
    "normal_load_n=0.5": "normal_load_n: stands beside force_z; keep one of them",
    "speed_mm_s=fast": "speed_mm_s: Input should be a valid number",
    "speed_mm_s=0.1": "speed_mm_s: is 0.1 mm/s",
    f"participant={'[' * 100_000}": "participant: String should have at most 100 characters",
    "participant=": "participant: String should have at least 1 character",
    "a.b.c=1": "--set: is 'a.b.c=1'; accepted: force_x.unit=mN",
    "force_x": "--set: is 'force_x'; accepted: force_x.unit=mN",
    "tones_hz=[0]": "tones_hz.0: Input should be greater than 0",
    "tones_hz=[15000]": "tone_hz",
    "carrier_hz=1": "carrier_hz: is 1 Hz",
    "screen_peak_v=5": "drive_vpp",
}


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory, recorded: Swipes) -> Path:
    """Return a file with a map that is right."""
    path = tmp_path_factory.mktemp("wrong") / "swipe.csv"
    write_csv(recorded, path)
    result = CliRunner().invoke(
        app, ["study", "import", str(path), str(path.with_suffix(".h5")), "--yes"]
    )
    assert result.exit_code == 0, result.stderr
    return path


@pytest.mark.parametrize("entry", WRONG)
def test_a_wrong_map_gives_a_sentence(entry: str, mapped: Path, tmp_path: Path) -> None:
    out = tmp_path / "never.h5"
    result = CliRunner().invoke(app, ["study", "import", str(mapped), str(out), "--set", entry])
    assert result.exit_code == 2, result.stderr
    assert WRONG[entry] in result.stderr
    assert "unexpected" not in result.stderr
    assert not out.exists()


def test_a_force_without_its_mean_is_named_where_it_gives_the_direction(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    """A recording that was high-pass filtered has no direction in its sign."""
    path = tmp_path / "filtered.csv"
    np.savetxt(path, rng.normal(scale=0.02, size=10_000))
    said = ["force_x.column=column 1", "force_x.unit=N", "rate_hz=20000", "normal_load_n=0.5"]
    said.append("stage_speed_mm_s=40")
    answers = [word for entry in said for word in ("--set", entry)]
    command = ["study", "import", str(path), str(tmp_path / "never.h5"), "--yes", *answers]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 2
    assert "no stroke is found" in result.stderr
    assert "a force without its mean" in result.stderr


def test_a_channel_is_left_away(mapped: Path, tmp_path: Path) -> None:
    """A clock too coarse for its samples cannot be mended: the rate is given instead."""
    out = tmp_path / "study.h5"
    words = ["study", "import", str(mapped), str(out), "--set", "time=", "--set"]
    result = CliRunner().invoke(app, [*words, "rate_hz=20000"])
    assert result.exit_code == 0, result.stderr
    assert out.exists()


def test_an_entry_of_text_may_look_like_a_number(mapped: Path) -> None:
    """The unit 1, a column of a table without names, and most pseudonyms."""
    said = ["participant=07", "force_x.column=2", "drive_fraction.unit=1", "rig=3"]
    said += ["drive_voltage=", 'drive_fraction.column="U [V]"', "session=2"]
    found = changed(load_map(map_beside(mapped)), said)
    assert (found.participant, found.rig, found.session) == ("07", "3", 2)
    assert found.channels["force_x"].column == "2"
    assert (found.channels["drive_fraction"].column, found.channels["drive_fraction"].unit) == (
        "U [V]",
        "1",
    )


def test_a_clock_that_is_rounded_from_some_row_on_is_named_with_the_way_out() -> None:
    """Six digits, as NumPy and spreadsheets are often told to write, end at 10 s."""
    time_s = np.array([float(f"{value:.6g}") for value in np.arange(220_000) / 20_000.0])
    sentence = "rounded to coarser.*leave it away .time=. and give rate_hz, which is 20000 by"
    with pytest.raises(StudyError, match=sentence):
        on_grid(time_s, np.zeros(time_s.size))


def test_a_recording_without_a_drive_is_told_to_be_blank(mapped: Path, tmp_path: Path) -> None:
    words = ["study", "import", str(mapped), str(tmp_path / "study.h5")]
    result = CliRunner().invoke(app, [*words, "--set", "drive_voltage="])
    assert result.exit_code == 0, result.stderr
    assert "no drive is in the map: all trials are blank" in result.stdout


def test_a_long_import_tells_how_far_it_is(
    mapped: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study_import, "PACE_S", 0.0)
    monkeypatch.setattr(study_import, "TOLD_BYTES", 0)
    file = tmp_path / "swipe.csv"
    file.write_bytes(mapped.read_bytes())
    result = CliRunner().invoke(
        app, ["study", "import", str(file), str(tmp_path / "study.h5"), "--yes"]
    )
    assert result.exit_code == 0, result.stderr
    assert f"reading {file}, " in result.stderr
    assert f"{file}: 1 trials written" in result.stderr


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("= 3", "is no TOML"),
        ('schema = "column_map/2"\n[channels]', "schema: Input should be 'column_map/1'"),
        ("channels = 3", "channels: Input should be a valid dictionary"),
        ("[channels]\n[surprise]\na = 1", "surprise: Extra inputs are not permitted"),
        ('participant = "p\\u202e"\n[channels]', "participant has control or formatting"),
        ("a = " + "[" * 100_000, "is no TOML"),
        ("[channels]\n" + "#" * (1 << 20), "is larger than a column map can be"),
    ],
)
def test_a_damaged_map_gives_a_sentence(text: str, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / "some.toml"
    path.write_text(text)
    with pytest.raises(StudyError, match=sentence.replace("[", "\\[")):
        load_map(path)


def test_rows_without_a_time_are_missing_samples() -> None:
    time_s = np.array([np.nan, 0.0, 1.0, np.nan, 3.0, 4.0])
    found = on_grid(time_s, np.arange(6.0))
    assert (found.rate_hz, found.missing) == (1.0, 1)
    np.testing.assert_array_equal(found.values, [1.0, 2.0, np.nan, 4.0, 5.0])
    with pytest.raises(StudyError, match="not regular at row 4"):
        on_grid(np.array([np.nan, 0.0, 1.0, 2.0, 1.5, 4.0]), np.zeros(6))


def test_the_step_of_few_rows_is_one_of_theirs() -> None:
    found = on_grid(np.array([0.0, 1.0, 4.0]), np.zeros(3))
    assert (found.rate_hz, found.missing) == (1.0, 2)
