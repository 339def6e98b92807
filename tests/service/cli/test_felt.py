"""What is computed and shown of what the finger feels."""

import dataclasses
import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from tests.rig_status import rig_status

from frictus.messages import Applied, Fault, SceneState
from frictus.textures import Scene
from frictus_service.cli.checks import machine_checks, service_checks
from frictus_service.cli.streams.felt import RigSnapshot, band_rms, table_of

RATE_HZ = 20_000.0
NOTHING = RigSnapshot(None, None, None, None, None, {"force": 0}, {"force": 0}, {}, 5.0)


def test_band_rms_is_that_of_the_band(rng: np.random.Generator) -> None:
    time_s = np.arange(5_000) / RATE_HZ
    amplitude = rng.uniform(0.01, 0.5)
    hz = rng.uniform(60.0, 900.0)
    phase = rng.uniform(0.0, 2.0 * np.pi)
    tone = amplitude * np.sin(2.0 * np.pi * hz * time_s + phase)
    outside = 0.5 + 0.3 * np.sin(2.0 * np.pi * 2_000.0 * time_s)
    rms = band_rms(tone + outside, RATE_HZ)
    assert rms == pytest.approx(amplitude / np.sqrt(2.0), rel=0.01)


def test_too_little_signal_has_no_rms() -> None:
    assert band_rms(np.ones(1_999), RATE_HZ) is None
    assert band_rms(np.ones(0), RATE_HZ) is None


def test_silence_shows() -> None:
    output = io.StringIO()
    Console(file=output, width=100).print(table_of(NOTHING, "rig", 1.0))
    said = output.getvalue()
    assert "no finger state yet" in said
    assert "nothing from the rig for 5 s" in said


def test_what_others_write_is_no_markup() -> None:
    fault = Fault(kind="safety", reason="see [/dev/x] and [bold]", utc_ns=1, action="[reset]")
    told = rig_status(state="tripped", fault=fault, owner="ann [/]")
    felt = dataclasses.replace(NOTHING, status=told)
    output = io.StringIO()
    Console(file=output, width=100).print(table_of(felt, "linen[/].csv", 1.0))
    said = output.getvalue()
    for written in ("linen[/].csv", "ann [/]", "[/dev/x] and [bold]", "[reset]"):
        assert written in said


def test_what_became_of_a_scene_shows() -> None:
    notes = ["temporal frequencies moved by up to 0.05 Hz", "acceleration [m/s²], not friction"]
    applied = Applied(
        gain=1.0,
        feasible_gain=2.0,
        bias=0.2,
        bias_n=0.1,
        scaled=False,
        speed_range_mm_s=(0.0, 300.0),
        notes=[*notes, notes[0]],
    )
    scene = SceneState(etag="1", scene=Scene(), applied=applied)
    output = io.StringIO()
    felt = dataclasses.replace(NOTHING, scene=scene)
    Console(file=output, width=100).print(table_of(felt, "linen", 1.0))
    for note in notes:
        assert output.getvalue().count(note) == 1


def test_missing_packages_are_named() -> None:
    found = service_checks.packages(("numpy", "no-such-package-here"))
    assert found.verdict == "fail"
    assert "no-such-package-here" in found.found
    assert found.to_do


def test_a_router_that_is_no_endpoint_ends_no_other_check() -> None:
    (found,) = service_checks.router_and_rigs("lab:7447")
    assert found.verdict == "fail"
    assert "tcp/HOST:PORT" in found.found


def test_a_coarse_clock_is_a_warning() -> None:
    now_ns = iter(range(0, 10**15, 1_000_000))
    reads = (value // 15_000_000 * 15_000_000 for value in now_ns)  # a 15 ms clock
    assert machine_checks.clock_resolution(lambda: next(reads)).verdict == "warn"


def test_damaged_textures_are_named(tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text("{")
    found = service_checks.library_folder(tmp_path)
    assert found.verdict == "warn"
    assert "broken" in found.found
