"""Samples and texts from files that anybody may have written: bounded, every refusal named."""

import math
import os
import re
import struct
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from frictus.errors import TextureError, UnreadableFileError
from frictus.files import read_bounded, require_file
from frictus.textures import MAX_PROFILE_SAMPLES

FloatArray = NDArray[np.float64]

MAX_WAV_SAMPLES: Final = 8_000_000
"""Of one channel: three minutes at 44.1 kHz."""
PCM, FLOAT, EXTENSIBLE = 1, 3, 0xFFFE
ACCEPTED_BITS: Final = {PCM: (8, 16, 24, 32), FLOAT: (32, 64)}
"""By the format code of a WAV file."""
MAX_WAV_CHUNKS: Final = 1000
"""Before that of the samples."""
MAX_TEXT_BYTES: Final = 10_000_000
MAX_CSV_COLUMNS: Final = 100
"""Looked at; a header may have more than the samples."""
UNIT: Final = re.compile(r"[\[(]([^\])]*)[\])]\s*\"?$")
"""Of a column, behind its name."""
SECONDS: Final = ("s", "sec", "seconds")
EVEN_SHARE: Final = 0.01  # times may stray from an even grid by this share of a step


def read_wav(path: Path, channel: int) -> tuple[FloatArray, float]:
    """Return one channel of a WAV file, full scale +/-1, and its rate in Hz.

    The `wave` module knows neither floats nor, before Python 3.12, the extensible header with
    which 24 bits are usually written.

    Parameters
    ----------
    path : Path
        PCM of 8, 16, 24 or 32 bits, or floats of 32 or 64.
    channel : int
        From 0.

    Raises
    ------
    TextureError
        If the file is none, has no such channel, too many samples or fewer than it declares.
    """
    require_file(path)
    with path.open("rb") as file:
        head = file.read(12)
        require(
            head[:4] == b"RIFF" and head[8:] == b"WAVE", f"{path.name} is not a WAV file (RIFF)"
        )
        form, size = _wav_format(file, path)
        code, channels, rate_hz, _, _, bits = struct.unpack_from("<HHIIHH", form)
        if code == EXTENSIBLE:  # the first two bytes of its subformat
            code = int.from_bytes(form[24:26], "little")
        require(
            bits in ACCEPTED_BITS.get(code, ()),
            f"{path.name} has samples of {bits} bits in WAV format {code}; PCM (1) of 8, 16, "
            "24 or 32 bits and floats (3) of 32 or 64 are accepted: convert it",
        )
        require(
            0 <= channel < channels,
            f"{path.name} has {channels} channels, numbered from 0, no channel {channel}",
        )
        frame_bytes = channels * bits // 8
        count = size // frame_bytes
        require(
            count <= MAX_WAV_SAMPLES,
            f"{path.name} has {count} samples; at most {MAX_WAV_SAMPLES} are read: cut it",
        )
        raw = file.read(count * frame_bytes)
        require(
            len(raw) == count * frame_bytes,
            f"{path.name} ends early: it declares {count} samples and has "
            f"{len(raw) // frame_bytes}; write it anew",
        )
    octets = np.frombuffer(raw, np.uint8).reshape(-1, channels, bits // 8)[:, channel]
    if code == FLOAT:
        floats = np.ascontiguousarray(octets).view(f"<f{bits // 8}")[:, 0].astype(np.float64)
        require(
            bool(np.isfinite(floats).all()), f"{path.name} has samples that are not numbers"
        )
        return floats, float(rate_hz)
    if bits == 8:  # unsigned
        return (octets[:, 0].astype(np.float64) - 128.0) / 128.0, float(rate_hz)
    padded = np.zeros((octets.shape[0], 4), dtype=np.uint8)
    padded[:, 4 - bits // 8 :] = octets  # into the high bytes, so that the sign is kept
    return padded.view("<i4")[:, 0].astype(np.float64) / 2.0**31, float(rate_hz)


def _wav_format(file: BinaryIO, path: Path) -> tuple[bytes, int]:
    """Read up to the first sample; return the format chunk and how many bytes follow."""
    form = b""
    for _ in range(MAX_WAV_CHUNKS):  # a file of zeros is nothing but empty chunks
        if len(chunk := file.read(8)) < 8:
            break
        size = int.from_bytes(chunk[4:], "little")
        if chunk[:4] == b"data":
            require(len(form) >= 16, f"{path.name} is not a WAV file: it tells no format")
            return form, size
        skipped = size + size % 2
        if chunk[:4] == b"fmt ":
            form = file.read(min(size, 40))
            skipped -= len(form)
        file.seek(skipped, os.SEEK_CUR)
    raise TextureError(f"{path.name} is not a WAV file with samples: there is no chunk 'data'")


def read_csv(
    path: Path, sample_rate_hz: float | None, scaled: bool = True
) -> tuple[FloatArray, float]:
    """Return the samples of a CSV file and their rate in Hz.

    Parameters
    ----------
    path : Path
        One column of samples, or two: time in s and sample.
    sample_rate_hz : float or None
        Rate of a single column.
    scaled : bool
        Whether whoever reads it says what a number of it is in newtons.

    Raises
    ------
    TextureError
        If it holds something else; the text names the line.
    """
    rows: list[list[float]] = []
    first_line = True
    for number, line in enumerate(read_text(path).splitlines(), 1):
        require(
            len(rows) <= MAX_PROFILE_SAMPLES,
            f"{path.name} has more lines of samples than are read: at most "
            f"{MAX_PROFILE_SAMPLES}; convert it to WAV",
        )
        separator = "," if "," in line else ";"
        columns = line.count(separator) + 1
        require(columns <= MAX_CSV_COLUMNS, f"{path.name}, line {number}: {columns} columns")
        cells = [cell.strip() for cell in line.split(separator)]
        if not any(cells):
            continue
        if len(cells) > 1 and not cells[-1]:  # programs end rows in a separator
            cells.pop()
        try:
            row = [float(cell.replace("_", "?")) for cell in cells]  # 1_0 is no number
        except ValueError:
            require(
                first_line,
                f"{path.name}, line {number}: {line[:60]!r} is not numbers; accepted: one line "
                "of names, then numbers with a decimal point, a comma or semicolon between two",
            )
            _check_units(cells, path.name, scaled)
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
        require(
            all(math.isfinite(value) for value in row),
            f"{path.name}, line {number}: NaN and infinities are not accepted",
        )
        rows.append(row)
    require(len(rows) >= 2, f"{path.name}: {len(rows)} samples; at least 2 make a texture")
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


def _check_units(names: list[str], file: str, scaled: bool) -> None:
    """Refuse a line of names that says another unit than the numbers are taken to have."""
    units = [found[1].strip() if (found := UNIT.search(name)) else "" for name in names]
    if len(names) == 2:
        require(
            units[0] in ("", *SECONDS),
            f"{file}: its times are in {units[0][:20]!r}; only s are accepted: convert them",
        )
    require(
        scaled or units[-1] in ("", "N"),
        f"{file}: its samples are in {units[-1][:20]!r}: give scale_n, the N of one of them",
    )


def _rate_of(time_s: FloatArray, name: str) -> float:
    step_s = (time_s[-1] - time_s[0]) / (time_s.size - 1)
    require(
        step_s > 0.0,
        f"{name}: the times in its first column do not rise; where the comma is a decimal one, "
        "write points",
    )
    even = time_s[0] + step_s * np.arange(time_s.size)
    stray = np.abs(time_s - even)
    # Printed times are rounded; a grid is even if no time strays by a visible part of a step.
    worst = int(np.argmax(stray))
    require(
        stray[worst] <= EVEN_SHARE * step_s,
        f"{name}: sample {worst} stands {stray[worst] / step_s:.2g} steps off an even grid; "
        "resample it evenly",
    )
    return float(1.0 / step_s)


def read_bytes(path: Path) -> bytes:
    """Return the content of a file of at most `MAX_TEXT_BYTES`.

    Parameters
    ----------
    path : Path
        Of the file.

    Raises
    ------
    TextureError
        If it is longer, a pipe or a device.
    """
    try:
        return read_bounded(path, MAX_TEXT_BYTES)
    except UnreadableFileError as error:
        raise TextureError(f"{path.name}: {error.strerror}") from error


def read_text(path: Path) -> str:
    """Return the text of a file of at most `MAX_TEXT_BYTES`.

    Parameters
    ----------
    path : Path
        In UTF-8.

    Raises
    ------
    TextureError
        If it is longer, or no UTF-8.
    """
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TextureError(f"{path.name} is not text in UTF-8: {error}") from error


def require(holds: bool, complaint: str) -> None:
    """Raise if something does not hold.

    Parameters
    ----------
    holds : bool
        Whether it does.
    complaint : str
        What is wrong, what is accepted.

    Raises
    ------
    TextureError
        With the complaint.
    """
    if not holds:
        raise TextureError(complaint)
