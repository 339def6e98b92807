"""Textures from files: what is read, and what is refused with which reason."""

import math
import struct
import wave
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.clients.effect_files.made import (
    ahap,
    band,
    basis,
    continuous,
    haptic,
    hjif,
    keyframes,
)

from frictus.errors import TextureError
from frictus.recordings import import_texture, load_texture, profile_of
from frictus.textures import Profile


def write_wav(path: Path, channels: np.ndarray, width: int, rate_hz: int = 8_000) -> Path:
    """Write samples in [-1, 1), shape (n_channels, n_samples), with `width` bytes each."""
    counts = np.round(channels.T * 2.0 ** (8 * width - 1)).astype(np.int64)
    if width == 1:
        counts = counts + 128
    octets = (
        np.ascontiguousarray(counts, "<i8")
        .view(np.uint8)
        .reshape(*counts.shape, 8)[..., :width]
    )
    with wave.open(str(path), "wb") as file:
        file.setnchannels(channels.shape[0])
        file.setsampwidth(width)
        file.setframerate(rate_hz)
        file.writeframes(octets[..., :width].tobytes())
    return path


def wav_of(code: int, channels: int, bits: int, data: bytes, extensible: bool = False) -> bytes:
    """Return a WAV file, by its header; a chunk of odd length stands before the samples."""
    frame = channels * bits // 8
    told = 0xFFFE if extensible else code
    form = struct.pack("<HHIIHH", told, channels, 8_000, 8_000 * frame, frame, bits)
    if extensible:
        form += struct.pack("<HHIH14s", 22, bits, 0, code, bytes(14))
    chunks = [(b"fmt ", form), (b"LIST", b"odd"), (b"data", data)]
    body = b"WAVE" + b"".join(
        name + struct.pack("<I", len(content)) + content + bytes(len(content) % 2)
        for name, content in chunks
    )
    return b"RIFF" + struct.pack("<I", len(body)) + body


@pytest.mark.parametrize("width", [1, 2, 3, 4])
def test_a_wav_of_every_width_is_read_to_its_own_step(
    tmp_path: Path, rng: np.random.Generator, width: int
) -> None:
    samples = rng.uniform(-0.9, 0.9, (2, 400))
    path = write_wav(tmp_path / "stereo.wav", samples, width)
    texture = load_texture(path, speed_mm_s=40.0, scale_n=0.5, channel=1)
    assert isinstance(texture, Profile)
    assert texture.period_mm == pytest.approx(40.0 * 400 / 8_000)
    wanted = 0.5 * (samples[1] - samples[1].mean())
    step = 0.5 / 2.0 ** (8 * width - 1)
    np.testing.assert_allclose(texture.friction_n, wanted, atol=1.1 * step)


@pytest.mark.parametrize("extensible", [False, True])
@pytest.mark.parametrize(("code", "dtype"), [(1, "<i2"), (3, "<f4"), (3, "<f8")])
def test_a_wav_of_floats_and_one_with_an_extensible_header_are_read(
    tmp_path: Path, rng: np.random.Generator, code: int, dtype: str, extensible: bool
) -> None:
    samples = rng.uniform(-0.9, 0.9, (2, 400))
    scale = 2.0**15 if code == 1 else 1.0
    data = np.round(samples.T * scale, 0 if code == 1 else 9).astype(dtype).tobytes()
    path = tmp_path / "a.wav"
    path.write_bytes(wav_of(code, 2, 8 * np.dtype(dtype).itemsize, data, extensible))
    texture = load_texture(path, speed_mm_s=40.0, scale_n=0.5, channel=1)
    assert isinstance(texture, Profile)
    wanted = 0.5 * (samples[1] - samples[1].mean())
    np.testing.assert_allclose(
        texture.friction_n, wanted, atol=0.6 / scale if code == 1 else 1e-7
    )


def test_a_wav_that_ends_early_or_is_no_pcm_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    whole = wav_of(1, 1, 16, bytes(range(200)))
    for spoilt, said in [
        (whole[:-20], "declares 100 samples and has 90"),
        (wav_of(6, 1, 8, bytes(200)), "8 bits in WAV format 6"),
        (wav_of(1, 1, 12, bytes(200)), "12 bits"),
        (wav_of(1, 0, 16, bytes(200)), "has 0 channels"),
        (wav_of(3, 1, 32, np.full(50, np.nan, "<f4").tobytes()), "not numbers"),
        (whole[:30], "no chunk 'data'"),
        (whole[:12] + whole[36:], "tells no format"),
    ]:
        path.write_bytes(spoilt)
        with pytest.raises(TextureError, match=said):
            load_texture(path)


def test_without_a_speed_a_recording_is_temporal(tmp_path: Path) -> None:
    path = write_wav(tmp_path / "a.wav", np.sin(np.arange(800.0))[np.newaxis] * 0.9, 2)
    texture = load_texture(path)
    assert isinstance(texture, Profile)
    assert texture.period_mm is None
    assert texture.period_s == pytest.approx(0.1)


def test_a_column_of_newtons_becomes_a_period_in_mm(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("friction_N\n0.1\n0.3\n\n0.2\n0.2\n", encoding="utf-8")
    texture = load_texture(path, speed_mm_s=50.0, sample_rate_hz=100.0, angle_deg=90.0)
    assert isinstance(texture, Profile)
    assert texture.friction_n == pytest.approx([-0.1, 0.1, 0.0, 0.0])
    assert texture.period_mm == pytest.approx(2.0)
    assert texture.angle_deg == 90.0


def test_rows_may_end_in_a_separator(tmp_path: Path) -> None:
    """A row that cannot be read because of it was quoted as no numbers."""
    path = tmp_path / "a.csv"
    rows = "\n".join(f"{n / 1000:.6f},{0.1 * (n % 2)}," for n in range(100))
    path.write_text("time,force\n" + rows, encoding="utf-8")
    texture = load_texture(path)
    assert isinstance(texture, Profile)
    assert texture.period_s == pytest.approx(0.1)
    assert texture.friction_n[:2] == pytest.approx([-0.05, 0.05])


def test_two_columns_bring_their_own_rate(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = "\n".join(f"{5 + n / 1000:.6f};{0.1 * (n % 2)}" for n in range(100))
    path.write_text("\ufefftime;force\n" + rows, encoding="utf-8")
    texture = load_texture(path)
    assert isinstance(texture, Profile)
    assert texture.period_s == pytest.approx(0.1)
    with pytest.raises(TextureError, match="its times say 1000 Hz, not 2000 Hz"):
        load_texture(path, sample_rate_hz=2_000.0)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "0 samples; at least 2"),
        ("header\n", "0 samples; at least 2"),
        ("1\n", "1 samples; at least 2"),
        ("1\n2\nx\n", "line 3: 'x' is not numbers"),
        ("1\n1_0\n", "line 2: '1_0' is not numbers"),
        ("1\n\n\nNaN\n", "line 4: NaN"),
        ("1\ninf\n", "line 2: NaN and infinities"),
        ("1\n1e999\n", "line 2: NaN and infinities"),
        ("1\n1,2\n", "line 2: 2 columns"),
        ("1,2,3\n", "line 1: 3 columns"),
        ("0,1\n0,2\n", "do not rise"),
        ("0,1\n0.1,2\n0.3,3\n0.4,1\n", "off an even grid"),
        ("1\n1\n1\n", "constant friction is no texture"),
        ("0\n30\n", "reaches 15 N; at most 10 N"),
        ("1\n2\n" * 40_000, "at most 65536"),
        ("1\n2\n" * 5_000, "period_s"),
    ],
)
def test_a_bad_csv_is_refused_with_the_reason(
    tmp_path: Path, text: str, complaint: str
) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    rate_hz = None if "," in text else 500.0
    with pytest.raises(TextureError, match=complaint) as refused:
        load_texture(path, sample_rate_hz=rate_hz)
    assert "bad.csv" in str(refused.value)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_absurd_numbers_are_refused(tmp_path: Path, value: float) -> None:
    path = tmp_path / "a.csv"
    path.write_text("1\n2\n", encoding="utf-8")
    with pytest.raises(TextureError, match="sample_rate_hz"):
        load_texture(path, sample_rate_hz=value)
    with pytest.raises(TextureError, match="speed_mm_s"):
        load_texture(path, speed_mm_s=value, sample_rate_hz=100.0)
    if value != -1.0:
        with pytest.raises(TextureError, match="scale_n"):
            load_texture(path, sample_rate_hz=100.0, scale_n=value)


def test_a_column_without_a_rate_asks_for_it(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("1\n2\n", encoding="utf-8")
    with pytest.raises(TextureError, match="give its sample_rate_hz"):
        load_texture(path)


def test_what_is_not_a_wav_or_not_text_is_refused(tmp_path: Path) -> None:
    wav, table = tmp_path / "a.wav", tmp_path / "a.csv"
    wav.write_bytes(b"RIFFgarbage")
    table.write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(TextureError, match="not a WAV"):
        load_texture(wav)
    with pytest.raises(TextureError, match="not text in UTF-8"):
        load_texture(table)
    with pytest.raises(TextureError, match=r"\.hmpg are accepted"):
        load_texture(tmp_path / "a.mp3")
    with pytest.raises(FileNotFoundError):
        load_texture(tmp_path / "absent.csv")
    good = write_wav(tmp_path / "b.wav", np.array([[0.1, 0.2]]), 2)
    with pytest.raises(TextureError, match="no channel 1"):
        load_texture(good, channel=1)
    with pytest.raises(TextureError, match="8000 Hz, not 44100"):
        load_texture(good, sample_rate_hz=44_100.0)


@settings(deadline=None)
@given(st.binary(max_size=300))
def test_a_garbage_wav_is_a_texture_error(
    tmp_path_factory: pytest.TempPathFactory, tail: bytes
) -> None:
    path = tmp_path_factory.mktemp("garbage") / "a.wav"
    head = b"RIFF\x80\0\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0\x40\x1f\0\0\x80\x3e\0\0\x02\0\x10\0"
    path.write_bytes(head + tail)
    try:
        load_texture(path)
    except TextureError:
        pass


@pytest.mark.timeout(20)
def test_a_wav_that_was_never_written_is_refused_at_once(tmp_path: Path) -> None:
    """Its room was reserved, and reads as empty chunks: of 3 GB for more than a minute."""
    path = tmp_path / "reserved.wav"
    with path.open("wb") as file:
        file.write(b"RIFF\0\0\0\0WAVE")
        file.truncate(3 << 30)
    with pytest.raises(TextureError, match="no chunk 'data'"):
        load_texture(path, speed_mm_s=40.0)


def test_a_texture_document_is_read_as_it_stands(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text('{"kind": "slope", "peak_hz": 100, "low_order": 2, "high_order": 2,'
                    ' "rms_n": 0.1}', encoding="utf-8")  # fmt: skip
    assert load_texture(path).kind == "slope"
    with pytest.raises(TextureError, match="no speed"):
        load_texture(path, speed_mm_s=40.0)
    with pytest.raises(TextureError, match="no scale"):
        load_texture(path, scale_n=2.0)
    with pytest.raises(TextureError, match="no angle"):
        load_texture(path, angle_deg=90.0)
    for text in ("", "[]", '{"kind": "slope"}', '{"kind": "slime"}', '{"rms_n": 1e999}'):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(TextureError, match=r"^a\.json: not a texture"):
            load_texture(path)


def test_a_texture_document_with_a_word_that_none_has_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text('{"kind": "profile", "friction_n": [0, 0.1], "period_mm": 2, "angle": 90}')
    with pytest.raises(TextureError, match="angle: Extra inputs"):
        load_texture(path)


@given(st.integers(2, 300), st.floats(0.1, 5.0))
def test_a_profile_has_no_mean_and_keeps_its_shape(count: int, scale_n: float) -> None:
    friction = scale_n * np.cos(np.arange(count))
    profile = profile_of(friction, 1_000.0, 20.0)
    assert abs(np.mean(profile.friction_n)) < 1e-12
    np.testing.assert_allclose(np.diff(profile.friction_n), np.diff(friction), atol=1e-12)


def test_a_minute_at_44_khz_keeps_what_a_profile_holds_and_says_what_it_loses(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rate_hz, seconds, speed = 44_100, 60, 16.0
    time_s = np.arange(seconds * rate_hz) / rate_hz
    kept, lost = np.sin(2.0 * np.pi * 500.0 * time_s), np.sin(2.0 * np.pi * 9_000.0 * time_s)
    path = write_wav(tmp_path / "long.wav", np.array([0.4 * kept + 0.4 * lost]), 2, rate_hz)
    texture = load_texture(path, speed_mm_s=speed)
    assert isinstance(texture, Profile)
    assert texture.period_mm == pytest.approx(960.0)
    grid_s = np.arange(65_536) * seconds / 65_536
    wanted = 0.4 * np.sin(2.0 * np.pi * 500.0 * grid_s)
    np.testing.assert_allclose(texture.friction_n, wanted, atol=1e-5)
    assert "2646000 samples" in caplog.text
    assert "below 29 mm/s" in caplog.text
    part = load_texture(path, speed_mm_s=speed, part_s=(2.0, 3.0))
    assert isinstance(part, Profile)
    assert len(part.friction_n) == rate_hz
    assert part.period_mm == pytest.approx(16.0)


@pytest.mark.parametrize("part_s", [(0.0, 9.0), (-1.0, 0.5), (0.5, 0.5), (math.nan, 1.0)])
def test_a_part_beside_the_recording_is_refused(
    tmp_path: Path, part_s: tuple[float, float]
) -> None:
    path = write_wav(tmp_path / "a.wav", np.sin(np.arange(8_000.0))[np.newaxis] * 0.9, 2)
    with pytest.raises(TextureError, match="within the 1 s"):
        load_texture(path, speed_mm_s=40.0, part_s=part_s)


def test_more_of_a_recording_than_any_screen_shows_is_refused(tmp_path: Path) -> None:
    path = write_wav(tmp_path / "a.wav", np.sin(np.arange(16_000.0))[np.newaxis] * 0.9, 2)
    with pytest.raises(TextureError, match=r"1200 mm; at most 1000 mm.*part_s 1\.67 s"):
        load_texture(path, speed_mm_s=600.0)


# Effects; what they render to is in tests/clients/effect_files


def test_an_effect_is_a_texture_over_time_or_at_a_speed_over_position(tmp_path: Path) -> None:
    path = tmp_path / "a.ahap"
    path.write_text(ahap(continuous(0.0, 0.5, HapticSharpness=0.0)), encoding="utf-8")
    over_time = load_texture(path, scale_n=0.4)
    over_position = load_texture(path, 40.0, scale_n=0.4, angle_deg=90.0)
    assert isinstance(over_time, Profile)
    assert isinstance(over_position, Profile)
    assert over_time.period_s == pytest.approx(0.5)
    assert over_position.period_mm == pytest.approx(20.0)
    assert over_position.angle_deg == 90.0
    assert over_time.friction_n == over_position.friction_n
    assert max(over_time.friction_n) == pytest.approx(0.4, rel=0.01)
    part = load_texture(path, scale_n=0.4, part_s=(0.1, 0.2))
    assert isinstance(part, Profile)
    assert part.period_s == pytest.approx(0.1)


def test_what_an_effect_lost_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "a.haptic"
    path.write_text(haptic([(0.0, 0.5), (0.5, 0.5)]), encoding="utf-8")
    assert import_texture(path).notes == ("no frequency is given: 80 Hz",)
    load_texture(path)
    assert "a.haptic: no frequency is given: 80 Hz" in caplog.text
    push = band(
        "Curve", basis(0, keyframes((0, 0.0, None), (100, 1.0, None), (200, 0.5, None)))
    )
    path = tmp_path / "b.hjif"
    path.write_text(hjif(push), encoding="utf-8")
    assert "its mean, 0.62 of full scale, is removed" in "".join(import_texture(path).notes)


def test_an_effect_that_no_texture_can_hold_says_what_to_give(tmp_path: Path) -> None:
    path = tmp_path / "long.haptic"
    path.write_text(haptic([(0.0, 0.5), (11.0, 0.5)]), encoding="utf-8")
    with pytest.raises(
        TextureError, match=r"long.haptic: period_s: 11 s.*give a part.*or its speed"
    ):
        load_texture(path)
    load_texture(path, part_s=(0.0, 9.0))
    with pytest.raises(TextureError, match="it has 6000 Hz, not 100 Hz"):
        load_texture(path, sample_rate_hz=100.0)
    path.write_text(haptic([(0.0, 0.0), (1.0, 0.0)]), encoding="utf-8")
    with pytest.raises(TextureError, match="the effect is silent"):
        load_texture(path)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("time [ms],F [N]\n0,0.1\n1,0.2\n2,0.1\n", "its times are in 'ms'"),
        ("t (us);F\n0;0.1\n1;0.2\n2;0.1\n", "its times are in 'us'"),
        ("time [s],F [mN]\n0,0.1\n1,0.2\n2,0.1\n", "its samples are in 'mN': give scale_n"),
        ("time;F\n0,000;0,1\n0,001;0,2\n", "line 2.*decimal point"),
        ("time;F\ns;N\n0;0.1\n1;0.2\n", "line 2.*one line of names"),
        ("0,1\n0,2\n0,1\n", "decimal one, write points"),
    ],
)
def test_a_csv_says_in_which_units_it_is(text: str, told: str, tmp_path: Path) -> None:
    file = tmp_path / "swipe.csv"
    file.write_text(text)
    with pytest.raises(TextureError, match=told):
        load_texture(file, speed_mm_s=40.0)


def test_a_csv_of_another_force_is_read_with_its_scale(tmp_path: Path) -> None:
    file = tmp_path / "swipe.csv"
    file.write_text("time [s],F [mN]\n0,10\n1,30\n2,10\n3,30\n")
    found = load_texture(file, speed_mm_s=40.0, scale_n=0.001)
    assert isinstance(found, Profile)
    assert found.friction_n == pytest.approx([-0.01, 0.01, -0.01, 0.01])
