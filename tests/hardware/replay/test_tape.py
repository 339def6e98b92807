"""The file of a tape: what was written is read, and what cannot be played is refused."""

import io
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.hardware.replay.tapes import sine_tape

from frictus_hardware import ReplayConfig
from frictus_hardware.errors import ConfigError
from frictus_hardware.replay.tape import FORMS, Tape, read_tape, write_tape

SPANS = ((100, 900), (1_000, 1_500))
FLOATS = [name for name, (kinds, _) in FORMS.items() if "f" in kinds]


def written(path: Path, tape: Tape | None = None) -> Path:
    with path.open("wb") as file:
        write_tape(file, sine_tape(SPANS) if tape is None else tape)
    return path


def content() -> dict[str, Any]:
    """What is in a good file, by name."""
    buffer = io.BytesIO()
    write_tape(buffer, sine_tape(SPANS))
    buffer.seek(0)
    with np.load(buffer) as archive:
        return dict(archive)


def assert_same(one: Tape, other: Tape) -> None:
    for field in fields(Tape):
        mine, theirs = getattr(one, field.name), getattr(other, field.name)
        np.testing.assert_array_equal(mine, theirs, err_msg=field.name)
        assert np.asarray(mine).dtype == np.asarray(theirs).dtype


def test_what_was_written_is_read(tmp_path: Path) -> None:
    assert_same(read_tape(written(tmp_path / "tape.npz")), sine_tape(SPANS))


def test_another_program_may_write_plain_floats(tmp_path: Path) -> None:
    plain = content()
    plain["force"] = plain["force"] * 0.0005
    plain["force_step_n"] = np.float64(1.0)
    path = tmp_path / "plain.npz"
    np.savez_compressed(path, **plain)
    tape = read_tape(path)
    np.testing.assert_array_equal(tape.force, sine_tape(SPANS).force * 0.0005)


def refused(path: Path) -> str:
    with pytest.raises(ConfigError) as caught:
        ReplayConfig(file=path).make()
    text = str(caught.value)
    assert text.startswith(f"backend.file {path}: ")
    return text


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("schema", "replay/2", "'replay/2': this version plays 'replay/1'"),
        ("sample_rate_hz", 10.0, "1000 to 200000"),
        ("sample_rate_hz", "20 kHz", "accepted is"),
        ("lead_samples", 0, "1 sample to 1 s"),
        ("screen_mm", [70.0, -1.0], "above 0"),
        ("screen_mm", [10_001.0, 35.0], "to 10000"),
        ("screen_peak_v", 75.1, "to 75"),
        ("touch_latency_s", 1.5, "0 to 1"),
        ("finger_source", "mouse", "'pointer'"),
        ("force_step_n", 0.0, "above 0"),
        ("force", np.zeros((1_300, 2)), "(1300, 2) of float64; accepted is (1300, 3)"),
        ("accel", np.zeros((1_200, 3)), "accepted is (1300, 3)"),
        ("stretch_row", [0, 0], "growing"),
        ("stretch_row", [1, 800], "0, then"),
        ("stretch_row", [0, 1_300], "growing"),
        ("stretch_first_sample", [100, 900], "missing between"),
        ("stretch_first_sample", [-5, 1_000], "missing between"),
        ("stretch_first_sample", [100.0, 1_000.0], "accepted is"),
        ("touch_in_contact", [1, 0], "accepted is"),
    ],
)
def test_what_cannot_have_been_recorded_is_refused(
    tmp_path: Path, name: str, value: Any, words: str
) -> None:
    path = tmp_path / "bad.npz"
    np.savez(path, **(content() | {name: np.asarray(value)}))
    text = refused(path)
    assert name in text
    assert words in text


def test_touches_outside_or_out_of_order_are_refused(tmp_path: Path) -> None:
    good = content()["touch_arrival_sample"]
    for bad in (good[::-1], good + 1_000, good - 100):
        path = tmp_path / "bad.npz"
        np.savez(path, **(content() | {"touch_arrival_sample": bad}))
        assert "touch_arrival_sample: " in refused(path)


@pytest.mark.parametrize("name", list(FORMS))
def test_a_missing_field_is_named(tmp_path: Path, name: str) -> None:
    rest = content()
    del rest[name]
    path = tmp_path / "bad.npz"
    np.savez(path, **rest)
    assert f"{name} is missing" in refused(path)


@pytest.mark.parametrize("name", FLOATS)
@pytest.mark.parametrize("value", [np.nan, -np.inf])
def test_what_is_not_finite_is_refused(tmp_path: Path, name: str, value: float) -> None:
    spoilt = content()
    spoilt[name] = np.array(spoilt[name], dtype=np.float64)
    spoilt[name].flat[-1] = value
    path = tmp_path / "bad.npz"
    np.savez(path, **spoilt)
    assert f"{name}: NaN or infinite" in refused(path)


def test_a_tape_without_samples_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bad.npz"
    none = {name: content()[name][:0] for name in ("force", "accel", "voltage_v")}
    np.savez(path, **(content() | none))
    assert "no samples" in refused(path)


def test_torn_files_are_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    whole = written(tmp_path / "whole.npz").read_bytes()
    path = tmp_path / "torn.npz"
    for length in [0, 1, 100, len(whole) - 1, *rng.integers(1, len(whole), 10).tolist()]:
        path.write_bytes(whole[:length])
        assert "not a whole file" in refused(path)


def test_spoilt_bytes_are_refused_or_harmless(tmp_path: Path, rng: np.random.Generator) -> None:
    whole = written(tmp_path / "whole.npz").read_bytes()
    path = tmp_path / "spoilt.npz"
    for place in rng.integers(0, len(whole), 150).tolist():
        spoilt = bytearray(whole)
        spoilt[place] ^= int(rng.integers(1, 256))
        path.write_bytes(spoilt)
        try:
            tape = read_tape(path)
        except ConfigError:
            continue
        assert_same(tape, sine_tape(SPANS))


def test_a_folder_is_refused_as_one(tmp_path: Path) -> None:
    said = refused(tmp_path)
    assert "a folder; accepted: a file of replay/1" in said
    assert "frictus export" in said


def test_other_files_are_refused(tmp_path: Path) -> None:
    assert "No such file" in refused(tmp_path / "none.npz")
    text = tmp_path / "text.npz"
    text.write_text("force_n\n0.1\n", encoding="utf-8")
    assert "frictus export" in refused(text)
    one = tmp_path / "one.npy"
    np.save(one, np.zeros(3))
    assert "not a whole file" in refused(one)
    pickled = tmp_path / "pickled.npz"
    np.savez(pickled, **(content() | {"name": np.array({"a": 1}, dtype=object)}))
    assert "allow_pickle" in refused(pickled)
