"""Textures from files: recordings (WAV, CSV), texture documents (JSON), haptic effects.

What cannot be represented is refused with the reason; nothing is cut or resampled in silence.
"""

import logging
import math
import struct
import wave
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from frictus.errors import TextureError, explain
from frictus.imports import read_ahap, read_hjif
from frictus.textures import BAND_HZ, MAX_PROFILE_SAMPLES, PERIOD_MM, Profile, Texture

FloatArray = NDArray[np.float64]
log = logging.getLogger("frictus")

MAX_WAV_SAMPLES: Final = 8_000_000
"""Of one channel: three minutes at 44.1 kHz."""
MAX_JSON_BYTES: Final = 10_000_000
MAX_CSV_COLUMNS: Final = 100
"""Looked at; a header may have more than the samples."""
EVEN_SHARE: Final = 0.01  # times may stray from an even grid by this share of a step


def load_texture(
    path: str | Path,
    speed_mm_s: float | None = None,
    sample_rate_hz: float | None = None,
    scale_n: float = 1.0,
    *,
    channel: int = 0,
    angle_deg: float = 0.0,
    part_s: tuple[float, float] | None = None,
) -> Texture:
    """Read a texture from a file; the suffix says which format.

    ``.wav``: PCM of 8, 16, 24 or 32 bits; full scale is ``scale_n`` newtons. ``.csv``: newtons
    times `scale_n`, one column of samples or two columns, time in s and sample; a header line
    may stand first. ``.json``: a texture document as `frictus.textures` describes it. ``.ahap``
    and ``.hjif``: see `frictus.imports`.

    A recording becomes a `Profile` that repeats without end, over position where the recording
    speed is given, otherwise over time. Its mean is removed, since friction is relative: the
    rig adds the bias it needs. Where the last sample does not lead on to the first, the seam is
    felt once per period. A WAV of more than 65536 samples is resampled, and a warning of the
    logger `frictus` says below which speed of the finger detail is missing: of 60 s at 44.1 kHz
    and 16 mm/s, below 33 mm/s.

    Parameters
    ----------
    path : str or Path
        The file.
    speed_mm_s : float or None
        Speed of the recording, above 0; turns time into position.
    sample_rate_hz : float or None
        Rate of a one-column CSV; the other recordings bring theirs.
    scale_n : float
        Newtons per unit of the file, not 0; not for JSON, which is in newtons.
    channel : int
        Channel of a WAV file, from 0.
    angle_deg : float
        Direction of a spatial texture's phase, from x towards y.
    part_s : tuple of float or None
        From when to when of a recording, s; None is all of it. A texture covers at most 1000 mm
        or 10 s.

    Raises
    ------
    TextureError
        If the file cannot be read as a texture; the text says where and why.
    FileNotFoundError
        If there is no such file.

    Examples
    --------
    >>> load_texture("sandpaper.csv", speed_mm_s=40.0, sample_rate_hz=20_000.0)
    Profile(...)
    """
    path = Path(path)
    _require(scale_n != 0.0 and math.isfinite(scale_n), f"scale_n {scale_n}: finite, not 0")
    suffix = path.suffix.lower()
    if suffix in (".wav", ".csv"):
        if suffix == ".wav":
            samples, rate_hz = _read_wav(path, channel)
            if sample_rate_hz is not None and sample_rate_hz != rate_hz:
                raise TextureError(
                    f"{path.name} says {rate_hz:g} Hz, not {sample_rate_hz:g} Hz"
                )
        else:
            samples, rate_hz = _read_csv(path, sample_rate_hz)
        try:
            part = _part_of(samples, rate_hz, part_s)
            return profile_of(scale_n * part, rate_hz, speed_mm_s, angle_deg)
        except TextureError as error:
            raise TextureError(f"{path.name}: {error}") from error
    if suffix not in (".json", ".ahap", ".hjif"):
        raise TextureError(f"{path.name}: .wav, .csv, .json, .ahap and .hjif are accepted")
    unused = (speed_mm_s, sample_rate_hz, part_s) != (None, None, None)
    _require(not unused, f"{path.name} is not a recording: give it no speed, rate or part")
    text = _read_text(path)
    if suffix == ".json":
        _require(scale_n == 1.0, f"{path.name} is in newtons: give it no scale")
        return texture_of(text)
    return read_ahap(text, scale_n) if suffix == ".ahap" else read_hjif(text, scale_n)


def texture_of(text: str) -> Texture:
    """Read a texture document.

    Parameters
    ----------
    text : str
        JSON with a `kind`: spectrum, profile, beta, slope or map.

    Raises
    ------
    TextureError
        If it is not one; the text names the field.
    """
    adapter: TypeAdapter[Texture] = TypeAdapter(Texture)
    try:
        return adapter.validate_json(text)
    except ValidationError as error:
        raise TextureError(f"not a texture: {explain(error)}") from error


def profile_of(
    friction_n: FloatArray,
    sample_rate_hz: float,
    speed_mm_s: float | None = None,
    angle_deg: float = 0.0,
) -> Profile:
    """Make a repeating profile of recorded friction; its mean is removed.

    Parameters
    ----------
    friction_n : ndarray, shape (n_samples,)
        At least 2 samples, N, not all equal. More than 65536 are resampled, see `load_texture`.
    sample_rate_hz : float
        Rate of the recording.
    speed_mm_s : float or None
        Speed of the recording; None gives a temporal profile.
    angle_deg : float
        Direction of a spatial texture's phase.

    Raises
    ------
    TextureError
        If it cannot be represented; the text says why.
    """
    for name, value in (("sample_rate_hz", sample_rate_hz), ("speed_mm_s", speed_mm_s)):
        positive = value is None or (math.isfinite(value) and value > 0.0)
        _require(positive, f"{name} {value}: must be positive and finite")
    count = friction_n.size
    _require(count >= 2, f"{count} samples: at least 2 make a texture")
    duration_s = count / sample_rate_hz
    if speed_mm_s is not None:
        _require(
            speed_mm_s * duration_s <= PERIOD_MM[1],
            f"period_mm: {duration_s:.3g} s at {speed_mm_s:g} mm/s are "
            f"{speed_mm_s * duration_s:.4g} mm; at most {PERIOD_MM[1]:g} mm, more than any "
            f"screen: give as part_s {PERIOD_MM[1] / speed_mm_s:.3g} s of it",
        )
    _require(bool(np.all(np.isfinite(friction_n))), "a sample is not finite")
    centred = friction_n - np.mean(friction_n)
    if count > MAX_PROFILE_SAMPLES:
        centred = _resampled(centred, duration_s, speed_mm_s)
    level = float(np.max(np.abs(friction_n)))
    _require(
        float(np.max(np.abs(centred))) > 1e-9 * level,
        "all samples are equal: constant friction is no texture",
    )
    peak_n = float(np.max(np.abs(centred)))
    _require(peak_n <= 10.0, f"reaches {peak_n:.3g} N; at most 10 N: give a smaller scale_n")
    try:
        return Profile(
            friction_n=centred.tolist(),
            period_mm=None if speed_mm_s is None else speed_mm_s * duration_s,
            period_s=duration_s if speed_mm_s is None else None,
            angle_deg=angle_deg,
        )
    except ValidationError as error:
        raise TextureError(explain(error)) from error


def _part_of(
    samples: FloatArray, rate_hz: float, part_s: tuple[float, float] | None
) -> FloatArray:
    if part_s is None:
        return samples
    begin_s, end_s = part_s
    _require(
        0.0 <= begin_s < end_s <= samples.size / rate_hz,
        f"part_s {begin_s:g} to {end_s:g} s: rising, within the {samples.size / rate_hz:.4g} s "
        "that were recorded",
    )
    return samples[round(begin_s * rate_hz) : round(end_s * rate_hz)]


def _resampled(
    friction_n: FloatArray, duration_s: float, speed_mm_s: float | None
) -> FloatArray:
    """Return a period with as many samples as a profile holds, and say what that leaves out."""
    count = MAX_PROFILE_SAMPLES
    spectrum = np.fft.rfft(friction_n)[: count // 2]  # without the line at the new Nyquist
    highest_hz = (count // 2 - 1) / duration_s
    if speed_mm_s is not None:
        lost = f"below {speed_mm_s * BAND_HZ[1] / highest_hz:.2g} mm/s some detail is not felt"
    else:
        lost = f"what is above {highest_hz:.4g} Hz is left out"
    log.warning("%d samples became the %d of a profile: %s", friction_n.size, count, lost)
    return np.fft.irfft(spectrum, count) * (count / friction_n.size)


def _read_wav(path: Path, channel: int) -> tuple[FloatArray, float]:
    """Return one channel, full scale +/-1, and its rate."""
    try:
        with wave.open(str(path), "rb") as file:
            width, channels = file.getsampwidth(), file.getnchannels()
            rate_hz, count = float(file.getframerate()), file.getnframes()
            _require(
                0 <= channel < channels,
                f"{path.name} has channels 0 to {channels - 1}, no channel {channel}",
            )
            _require(
                count <= MAX_WAV_SAMPLES,
                f"{path.name} has {count} samples; at most {MAX_WAV_SAMPLES} are read: cut it",
            )
            raw = file.readframes(count)
    except (wave.Error, EOFError, RuntimeError, struct.error, ZeroDivisionError) as error:
        # The standard reader lets its own slips out on torn files.
        raise TextureError(
            f"{path.name} is not a WAV file with PCM samples ({error!r}); convert it to 16 bit"
        ) from error
    _require(width in (1, 2, 3, 4), f"{path.name}: {8 * width} bits; 8, 16, 24, 32 accepted")
    whole = len(raw) - len(raw) % (width * channels)
    octets = np.frombuffer(raw[:whole], dtype=np.uint8).reshape(-1, channels, width)[:, channel]
    if width == 1:  # 8-bit samples are unsigned
        return (octets[:, 0].astype(np.float64) - 128.0) / 128.0, rate_hz
    padded = np.zeros((octets.shape[0], 4), dtype=np.uint8)
    padded[:, 4 - width :] = octets  # into the high bytes, so that the sign is kept
    return padded.view("<i4")[:, 0].astype(np.float64) / 2.0**31, rate_hz


def _read_csv(path: Path, sample_rate_hz: float | None) -> tuple[FloatArray, float]:
    """Return the samples and their rate; every error names the line."""
    rows: list[list[float]] = []
    first_line = True
    for number, line in enumerate(_read_text(path).splitlines(), 1):
        _require(
            len(rows) <= MAX_PROFILE_SAMPLES,
            f"{path.name} has more lines of samples than are read: at most "
            f"{MAX_PROFILE_SAMPLES}; convert it to WAV",
        )
        separator = "," if "," in line else ";"
        columns = line.count(separator) + 1
        _require(columns <= MAX_CSV_COLUMNS, f"{path.name}, line {number}: {columns} columns")
        cells = [cell.strip() for cell in line.split(separator)]
        if not any(cells):
            continue
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            _require(
                first_line,
                f"{path.name}, line {number}: {line[:60]!r} is not numbers",
            )
            row = []
        first_line = False
        if not row:
            continue
        columns = len(rows[0]) if rows else len(row)
        if len(row) not in (1, 2) or len(row) != columns:
            raise TextureError(
                f"{path.name}, line {number}: {len(row)} columns; one (samples) or two "
                "(time in s, sample) are accepted, the same number in every line"
            )
        _require(
            all(math.isfinite(value) for value in row),
            f"{path.name}, line {number}: NaN and infinities are not accepted",
        )
        rows.append(row)
    _require(len(rows) >= 2, f"{path.name}: {len(rows)} samples; at least 2 make a texture")
    table = np.array(rows)
    if table.shape[1] == 2:
        rate_hz = _rate_of(table[:, 0], path.name)
        if sample_rate_hz is not None and not math.isclose(
            sample_rate_hz, rate_hz, rel_tol=1e-3
        ):
            raise TextureError(
                f"{path.name}: its times say {rate_hz:g} Hz, not {sample_rate_hz:g} Hz"
            )
        return table[:, 1], rate_hz
    if sample_rate_hz is None:
        raise TextureError(f"{path.name} has one column: give its sample_rate_hz")
    return table[:, 0], sample_rate_hz


def _rate_of(time_s: FloatArray, name: str) -> float:
    step_s = (time_s[-1] - time_s[0]) / (time_s.size - 1)
    _require(step_s > 0.0, f"{name}: the times in its first column do not rise")
    even = time_s[0] + step_s * np.arange(time_s.size)
    stray = np.abs(time_s - even)
    # Printed times are rounded; a grid is even if no time strays by a visible part of a step.
    worst = int(np.argmax(stray))
    _require(
        stray[worst] <= EVEN_SHARE * step_s,
        f"{name}: sample {worst} stands {stray[worst] / step_s:.2g} steps off an even grid; "
        "resample it evenly",
    )
    return float(1.0 / step_s)


def _read_text(path: Path) -> str:
    size = path.stat().st_size
    _require(size <= MAX_JSON_BYTES, f"{path.name}: {size} bytes; at most {MAX_JSON_BYTES}")
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise TextureError(f"{path.name} is not text in UTF-8: {error}") from error


def _require(holds: bool, complaint: str) -> None:
    if not holds:
        raise TextureError(complaint)
