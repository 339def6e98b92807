"""A table of responses whose law is known gives that law; what is no table is left alone."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from typer.testing import CliRunner

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.cli.app import app
from frictus_service.data_import.response_table import response_of
from frictus_service.errors import FieldError
from frictus_service.identification.fit.transfer_functions import fit_response

HZ = np.geomspace(30.0, 3000.0, 25)


def law(hz: FloatArray) -> ComplexArray:
    """Return 0.4 N, 850 Hz, 120 µs."""
    found = 0.4 / (1.0 + 1j * hz / 850.0) * np.exp(-2j * np.pi * hz * 120e-6)
    return np.asarray(found, np.complex128)


def test_without_noise_the_law_is_found() -> None:
    found = fit_response(HZ, law(HZ))
    assert found.gain.value == pytest.approx(0.4, rel=1e-6)
    assert found.cutoff_hz.value == pytest.approx(850.0, rel=1e-6)
    assert found.delay_s.value == pytest.approx(120e-6, abs=1e-9)


def test_intervals_hold_the_law(rng: np.random.Generator) -> None:
    """95 % of 200 tables: 95 % is 180 to 198 of them with a chance of 99.7 %."""
    held = np.zeros(3)
    coherence = rng.uniform(0.5, 0.999, HZ.size)
    relative = 0.1 * np.sqrt((1.0 - coherence) / coherence)
    for _ in range(200):
        noise = rng.standard_normal((2, HZ.size))
        found = fit_response(
            HZ, law(HZ) * (1.0 + relative * (noise[0] + 1j * noise[1])), coherence
        )
        for number, (estimate, truth) in enumerate(
            ((found.gain, 0.4), (found.cutoff_hz, 850.0), (found.delay_s, 120e-6))
        ):
            assert estimate.ci95 is not None
            held[number] += estimate.ci95[0] < truth < estimate.ci95[1]
    assert np.all((held >= 180) & (held <= 198)), held


@pytest.mark.parametrize("layout", ["parts.csv", "analyser.csv", "bode.csv", "complex.mat"])
def test_the_command_fits_a_table(layout: str, tmp_path: Path) -> None:
    path, response = tmp_path / layout, law(HZ)
    if layout == "complex.mat":
        savemat(path, {"f": HZ, "H": response})
    elif layout == "parts.csv":
        table = np.column_stack([HZ, response.real, response.imag, np.full(HZ.size, 0.9)])
        np.savetxt(path, table, "%.9g", ",", header="f [Hz],Re H,Im H,coherence", comments="")
    elif layout == "analyser.csv":  # each trace in each form, two traces of one response
        size_db = 20.0 * np.log10(np.abs(response))
        table = np.column_stack([HZ, *2 * [response.real, response.imag, size_db]])
        header = "Frequency (Hz)" + "".join(
            f",TR{trace}: Gain ({form})" for trace in (1, 2) for form in ("Real", "Imag", "dB")
        )
        np.savetxt(path, table, "%.9g", ",", header=header, comments="")
    else:
        size_db, phase = 20.0 * np.log10(np.abs(response)), np.unwrap(np.angle(response))
        table = np.column_stack([HZ / 1e3, size_db, np.rad2deg(phase)])
        header = "frequency (kHz);magnitude (dB);phase (deg)"
        np.savetxt(path, table, "%.9g", ";", header=header, comments="")
    result = CliRunner().invoke(app, ["identify", str(path), "--json"])
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["cutoff_hz"]["value"] == pytest.approx(850.0, rel=1e-4)
    assert found["delay_s"]["value"] == pytest.approx(120e-6, abs=1e-8)
    assert found["gain"]["value"] == pytest.approx(0.4, rel=1e-4)
    result = CliRunner().invoke(app, ["study", "import", str(path), str(tmp_path / "a.h5")])
    assert result.exit_code == 2
    assert "frictus identify fits gain, cutoff and delay to it" in result.stderr


@pytest.mark.parametrize(
    ("table", "header", "sentence"),
    [
        ([[-5, 1, 0]] * 6, "f,re,im", "frequency: has values below 0"),
        ([[5, -1, 0]] * 6, "f,mag,phase", "name the unit dB"),
        ([[5, 1, 0]] * 6, "f,mag,phase", 'names no unit: call it "phase (deg)" or'),
        ([[5, 1, 0]] * 6, "f,mag,phase (Hz)", 'names no unit: call it "phase (deg)" or'),
        ([[5, 1, 0, 2]] * 6, "f,re,im,coh", "accepted: squared coherence"),
        (
            [[5, 1, 0, 1, 2]] * 6,
            "f,H1 re,H1 im,H2 re,H2 im",
            "'H1 im' and 'H2 im' are both called like its imaginary part, and differ: save",
        ),
        (
            [[5, 1, 0, 2]] * 6,
            "f,1 mag,2 mag,2 phase (deg)",
            "'1 mag' and '2 mag' are both called like its magnitude, and differ: save",
        ),
        ([[5, 1, 0]] * 6, "a,b,c", "with columns called frequency, real and imag"),
        ([[5, 1, 0]] * 6, "f,re,im", "has 1 frequencies with a value; accepted: 4"),
    ],
)
def test_a_wrong_table_is_a_sentence(
    table: list[list[float]], header: str, sentence: str, tmp_path: Path
) -> None:
    path = tmp_path / "wrong.csv"
    np.savetxt(path, np.array(table), "%g", ",", header=header, comments="")
    result = CliRunner().invoke(app, ["identify", str(path)])
    assert result.exit_code == 2
    assert sentence in result.stderr


def test_one_response_in_two_units_is_one(tmp_path: Path) -> None:
    """Analysers write the magnitude in dB, too, and the phase in both units."""
    size, phase = np.abs(law(HZ)), np.unwrap(np.angle(law(HZ)))
    table = np.column_stack([HZ, 20.0 * np.log10(size), size, np.rad2deg(phase), phase])
    path = tmp_path / "both.csv"
    header = "f (Hz),gain (dB),gain,phase (deg),phase (rad)"
    np.savetxt(path, table, "%.4g", ",", header=header, comments="")
    result = CliRunner().invoke(app, ["identify", str(path), "--json"])
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["gain"]["value"] == pytest.approx(0.4, rel=0.01)


@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_a_phase_is_taken_in_its_unit_and_what_names_none_is_told(
    unit: str, tmp_path: Path
) -> None:
    """Radians without a unit were taken as degrees: the cutoff was half as high again."""
    phase = np.unwrap(np.angle(law(HZ)))
    table = np.column_stack(
        [HZ, np.abs(law(HZ)), np.rad2deg(phase) if unit == "deg" else phase]
    )
    path = tmp_path / "bode.csv"
    np.savetxt(path, table, "%.9g", ",", header=f"f,magnitude,phase ({unit})", comments="")
    result = CliRunner().invoke(app, ["identify", str(path), "--json"])
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["cutoff_hz"]["value"] == pytest.approx(850.0, rel=1e-4)
    assert found["delay_s"]["value"] == pytest.approx(120e-6, abs=1e-8)
    assert "f names no unit: taken as Hz" in found["notes"]
    assert any("magnitude names no unit: taken as a plain number" in n for n in found["notes"])


def test_a_response_before_its_drive_is_told(tmp_path: Path) -> None:
    """Of a law that is ahead by 50 us, as where a monitor was sampled beside the force."""
    ahead = law(HZ) * np.exp(2j * np.pi * HZ * 170e-6)
    for response, told in ((ahead, True), (law(HZ), False)):
        path = tmp_path / "table.csv"
        table = np.column_stack([HZ, response.real, response.imag])
        np.savetxt(path, table, "%.9g", ",", header="f [Hz],re,im", comments="")
        result = CliRunner().invoke(app, ["identify", str(path), "--json"])
        found = json.loads(result.stdout)
        assert any("the delay is below 0" in note for note in found["notes"]) == told


def test_a_flat_response_has_no_cutoff() -> None:
    with pytest.raises(FieldError, match="do not reach the cutoff"):
        fit_response(HZ, np.full(HZ.size, 0.4 + 0j))


def test_a_recording_is_no_table(tmp_path: Path) -> None:
    path = tmp_path / "recording.csv"
    np.savetxt(path, np.zeros((5, 2)), "%g", ",", header="t,Fx", comments="")
    assert response_of(path) is None
