"""Friction of slides whose law is known: exponents, periods, sawteeth, and none of them."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from frictus_hardware.arrays import FloatArray
from frictus_service.cli.app import app
from frictus_service.data_import.friction.coefficient import friction_coefficient
from frictus_service.data_import.friction.report import FrictionReport, report_friction
from frictus_service.data_import.friction.slides import Slide
from frictus_service.data_import.friction.stick_slip import _slips, stick_slip
from frictus_service.data_import.friction.texture import force_spectra
from frictus_service.errors import StudyError

RATE_HZ = 5000.0
SPEEDS_MM_S = (20.0, 40.0, 80.0, 160.0)
LOADS_N = (0.3, 0.6, 1.2)
Wave = Callable[[FloatArray, float, float], FloatArray]


def slides(rng: np.random.Generator, wave: Wave, driven: bool = False) -> list[Slide]:
    """Make slides of ``0.5 F_n^0.8 (v / 50)^0.1`` N, each 2 % off, with a wave on top."""
    made = []
    for number, speed in enumerate(np.tile(SPEEDS_MM_S, 6)):
        load = LOADS_N[number % len(LOADS_N)]
        time_s = np.arange(round(60.0 / speed * RATE_HZ)) / RATE_HZ
        level = 0.5 * load**0.8 * (speed / 50.0) ** 0.1 * np.exp(0.02 * rng.standard_normal())
        noise = 0.002 * rng.standard_normal(time_s.size)
        friction = level * (1.0 + wave(time_s, float(speed), level)) + noise
        normal = load + 0.002 * rng.standard_normal(time_s.size)
        made.append(
            Slide(RATE_HZ, 1 - 2 * (number % 2), float(speed), friction, normal, "N", driven)
        )
    return made


def smooth(time_s: FloatArray, speed_mm_s: float, level: float) -> FloatArray:
    return np.zeros(time_s.size)


def grating(time_s: FloatArray, speed_mm_s: float, level: float) -> FloatArray:
    return 0.05 * np.sin(2.0 * np.pi * speed_mm_s * time_s / 1.25)


def mains(time_s: FloatArray, speed_mm_s: float, level: float) -> FloatArray:
    return 0.05 * np.sin(2.0 * np.pi * 150.0 * time_s)


def sawtooth(time_s: FloatArray, speed_mm_s: float, level: float) -> FloatArray:
    """Stick for 40 ms, slip at once."""
    return 0.15 * (time_s / 0.04 % 1.0)


def report(rng: np.random.Generator, wave: Wave) -> FrictionReport:
    return report_friction(slides(rng, wave))


def test_exponents_of_speed_and_load(rng: np.random.Generator) -> None:
    found = report(rng, smooth).coefficient
    assert found is not None
    assert found.speed_exponent is not None
    assert found.load_exponent is not None
    assert found.speed_exponent.low < 0.1 < found.speed_exponent.high
    assert found.load_exponent.low < 0.8 < found.load_exponent.high
    truth = 0.5 * found.load_n**-0.2 * (found.speed_mm_s / 50.0) ** 0.1
    assert found.coefficient.low < truth < found.coefficient.high
    assert found.coefficient.high - found.coefficient.low < 0.05


def to_and_fro(rng: np.random.Generator, offset_n: float, count: int = 20) -> list[Slide]:
    """Make slides of coefficient 0.5 at 0.4 N, each 2 % off, and an offset of the sensor."""
    made = []
    for number in range(count):
        direction = 1 - 2 * (number % 2)
        friction = 0.2 * np.exp(0.02 * rng.standard_normal()) + direction * offset_n
        force = friction + 0.002 * rng.standard_normal(500)
        made.append(Slide(RATE_HZ, direction, 30.0, force, np.full(500, 0.4), "N", False))
    return made


@pytest.mark.parametrize("offset_n", [0.0, 0.1, 0.15, 0.3])
def test_an_offset_of_the_sensor_is_taken_off(
    offset_n: float, rng: np.random.Generator
) -> None:
    """As a factor between directions it made 0.433, 0.331 and 1.25 of 0.5.

    95 % of 100 intervals: 88 to 100 of them with a chance of 99.7 %.
    """
    held = np.zeros(2)
    for _ in range(100):
        found, notes = friction_coefficient(to_and_fro(rng, offset_n))
        assert found is not None
        assert found.offset_n is not None
        assert found.slides == 20
        assert found.coefficient.value == pytest.approx(0.5, rel=0.03)
        held += [
            found.coefficient.low < 0.5 < found.coefficient.high,
            found.offset_n.low < offset_n < found.offset_n.high,
        ]
        assert f"an offset of the sensor of {found.offset_n.value:.3g} N" in " ".join(notes)
    assert np.all(held >= 88), held


def test_slides_against_the_motion_are_told(rng: np.random.Generator) -> None:
    ways = to_and_fro(rng, 0.1, 40)
    turned = replace(ways[0], friction=-ways[0].friction)
    found, notes = friction_coefficient([turned, *ways[1:]])
    assert found is not None
    assert found.slides == 39
    assert "1 of 40 slides have friction against their motion" in " ".join(notes)
    wrong = [replace(each, friction=-each.friction) for each in ways]
    none, notes = friction_coefficient(wrong)
    assert none is None
    assert "40 of 40 slides have friction against their motion" in " ".join(notes)
    unloaded = [replace(each, normal=-each.normal) for each in ways[:3]]
    assert "3 slides lack" in " ".join(friction_coefficient([*unloaded, *ways[3:]])[1])


def test_one_direction_cannot_tell_an_offset(rng: np.random.Generator) -> None:
    found, notes = friction_coefficient(to_and_fro(rng, 0.1)[::2])
    assert found is not None
    assert found.offset_n is None
    assert "an offset of the tangential force cannot be told" in " ".join(notes)


def test_one_speed_shows_no_exponent(rng: np.random.Generator) -> None:
    same = [each for each in slides(rng, smooth) if each.speed_mm_s == 40.0]
    found = report_friction(same)
    assert found.coefficient is not None
    assert found.coefficient.speed_exponent is None
    assert "the speed varied too little" in " ".join(found.notes)


def test_a_texture_is_told_from_the_mains(rng: np.random.Generator) -> None:
    texture = report(rng, grating).texture
    assert texture is not None
    assert texture.origin == "texture"
    assert texture.period_mm is not None
    assert texture.period_mm.value == pytest.approx(1.25, rel=0.005)
    fixed = report(rng, mains).texture
    assert fixed is not None
    assert fixed.origin == "fixed frequency"
    assert fixed.frequency_hz is not None
    assert fixed.frequency_hz.value == pytest.approx(150.0, rel=0.05)
    nothing = report(rng, smooth).texture
    assert nothing is not None
    assert (nothing.origin, nothing.lines) == ("none", 0)


def test_bands_hold_the_power_of_the_force(rng: np.random.Generator) -> None:
    (spectrum,) = (each for each in report(rng, mains).spectra if each.speed_mm_s == 20.0)
    level = np.sqrt(np.square(spectrum.rms).sum())
    same = [each for each in slides(rng, mains) if each.speed_mm_s == 20.0]
    expected = np.mean([0.05 * each.friction.mean() / np.sqrt(2.0) for each in same])
    assert level == pytest.approx(expected, rel=0.1)
    strongest = spectrum.centre_hz[int(np.argmax(spectrum.rms))]
    assert abs(np.log10(strongest / 150.0)) < 0.05


def test_spectra_leave_out_slides_without_bands_and_of_other_rates(
    rng: np.random.Generator,
) -> None:
    """A slide without bands ended the command with an unexpected error."""
    long = to_and_fro(rng, 0.0, 6)
    short = [replace(each, friction=each.friction[:6], normal=each.normal[:6]) for each in long]
    other = replace(long[0], rate_hz=2.0 * RATE_HZ)
    (mixed,) = force_spectra([other, *short, *long[1:]])
    assert mixed == force_spectra(long[1:])[0]
    assert mixed.slides == 5
    assert force_spectra(short) == ()


def test_stick_slip_and_its_absence(rng: np.random.Generator) -> None:
    found = report(rng, sawtooth).stick_slip
    assert found is not None
    assert found.verdict == "stick-slip"
    assert found.slips_per_s is not None
    assert found.slips_per_s.value == pytest.approx(25.0, rel=0.1)
    assert found.drop_share == pytest.approx(0.14, abs=0.03)
    for wave in (smooth, grating, mains):
        other = report(rng, wave).stick_slip
        assert other is not None
        assert other.verdict == "none"


def stepped(made: list[Slide], step_n: float) -> list[Slide]:
    """Return slides as a sensor of so coarse a step measures them."""
    return [replace(each, friction=np.round(each.friction / step_n) * step_n) for each in made]


def test_the_steps_of_a_coarse_sensor_are_no_slips(rng: np.random.Generator) -> None:
    """Most steps of the friction are 0, so that each fall was beyond the bulk: 166 per s."""
    flat = stepped(slides(rng, smooth), 0.01)
    assert sum(_slips(each.friction, RATE_HZ)[1].size for each in flat) == 0
    found = stick_slip(flat)
    assert found is not None
    assert (found.verdict, found.slips_per_s, found.drop_share) == ("none", None, None)
    coarse = stick_slip(stepped(slides(rng, sawtooth), 0.01))
    assert coarse is not None
    assert coarse.verdict == "stick-slip"
    assert coarse.slips_per_s is not None
    assert coarse.slips_per_s.value == pytest.approx(25.0, rel=0.1)


def test_driven_slides_are_left_out(rng: np.random.Generator) -> None:
    both = slides(rng, smooth) + slides(rng, mains, driven=True)
    found = report_friction(both)
    assert (found.slides, found.driven) == (48, 24)
    assert found.texture is not None
    assert found.texture.lines == 0
    with pytest.raises(StudyError, match="all of 24 slides are driven"):
        report_friction(slides(rng, smooth, driven=True))


def test_the_command(rng: np.random.Generator, tmp_path: Path) -> None:
    """A stage at a known speed, to and fro: neither drive nor position was recorded."""
    time_s = np.arange(round(12.0 * RATE_HZ)) / RATE_HZ
    heading = np.where(np.floor(time_s / 1.5) % 2 == 0, 1.0, -1.0)
    friction = heading * (0.4 + 0.02 * np.sin(2.0 * np.pi * 40.0 * time_s / 2.0))
    friction += 0.003 * rng.standard_normal(time_s.size)
    path = tmp_path / "stage_40mmps.csv"
    np.savetxt(path, np.column_stack([time_s, friction]), "%.7g", ",", header="t [s],Ft [N]")
    run = ["study", "import", str(path), str(tmp_path / "study.h5"), "--yes"]
    result = CliRunner().invoke(app, [*run, "--set", "normal_load_n=0.8"])
    assert result.exit_code == 0, result.stderr
    assert "in the direction that the sign" in result.stdout
    assert "judged by steadiness only" in result.stdout
    for source in (path, tmp_path / "study.h5"):
        result = CliRunner().invoke(app, ["study", "show", "--friction", str(source), "--json"])
        assert result.exit_code == 0, result.stderr
        assert '"driven": 0' in result.stdout
        assert '"stick_slip": {' in result.stdout


def test_a_slow_log_of_a_stage_tells_the_coefficient(tmp_path: Path) -> None:
    """Tribometers write a row ten times a second; 0.6 N of friction at 3 N are 0.2."""
    file = tmp_path / "disc_75mmps.csv"
    rows = [f"{0.1 * row:.1f},0.6,3.0" for row in range(300)]
    file.write_text("\n".join(["t [s],Fx [N],Fz [N]", *rows]))
    runner = CliRunner()
    imported = runner.invoke(
        app, ["study", "import", str(file), str(tmp_path / "out.h5"), "--yes"]
    )
    assert "10 Hz is too slow" in imported.stderr  # for a study; its map is saved
    more = [file.with_name(f"disc{number}.csv") for number in range(2)]
    for each in more:
        each.write_bytes(file.read_bytes())
    maps = ["--map", str(file) + ".map.toml"]
    files = [str(each) for each in (file, *more)]
    result = runner.invoke(app, ["study", "show", "--friction", *files, *maps, "--json"])
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["slides"] == 3
    assert found["coefficient"]["coefficient"]["value"] == pytest.approx(0.2, rel=1e-6)
    assert found["coefficient"]["speed_mm_s"] == pytest.approx(75.0, rel=1e-6)


def test_positions_that_come_too_rarely_are_told(tmp_path: Path) -> None:
    """At 10 Hz no unit or sign is wrong."""
    file = tmp_path / "slow.csv"
    rows = [f"{0.1 * row:.1f},0.6,3.0,{7.5 * row:.1f}" for row in range(60)]
    file.write_text("\n".join(["t [s],Fx [N],Fz [N],x [mm]", *rows]))
    CliRunner().invoke(app, ["study", "import", str(file), str(tmp_path / "out.h5"), "--yes"])
    result = CliRunner().invoke(app, ["study", "show", "--friction", str(file)])
    assert result.exit_code == 2
    assert "rate of the positions, 30 Hz at least" in result.stderr


def test_rows_of_days_apart_tell_no_path(tmp_path: Path) -> None:
    """A path of 100 Hz through a thousand days would take all memory."""
    file = tmp_path / "days.csv"
    rows = [f"{86_400 * row},{0.6 if row // 100 % 2 else -0.6},3.0" for row in range(1_000)]
    file.write_text("\n".join(["t [s],Fx [N],Fz [N]", *rows]))
    given = [str(file), str(tmp_path / "out.h5"), "--yes", "--set", "stage_speed_mm_s=1"]
    result = CliRunner().invoke(app, ["study", "import", *given])
    assert result.exit_code == 2
    assert "too slow" in result.stderr
