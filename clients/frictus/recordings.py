"""Textures from files: recordings (WAV, CSV), texture documents (JSON), effect files.

What cannot be represented is refused with the reason; nothing is cut or resampled in silence.
"""

import logging
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from frictus.effect_files import EFFECT_SUFFIXES, render_effect
from frictus.errors import TextureError, explain, printable
from frictus.hatt import import_node
from frictus.sample_files import read_bytes, read_csv, read_text, read_wav, require
from frictus.textures import (
    BAND_HZ,
    MAX_PROFILE_SAMPLES,
    PERIOD_MM,
    PERIOD_S,
    Profile,
    Texture,
)

FloatArray = NDArray[np.float64]
log = logging.getLogger("frictus")

LEAST_MEAN: Final = 0.01
"""Of an effect, in shares of full scale, that is worth a word."""


@dataclass(frozen=True, slots=True)
class ImportedTexture:
    """A texture that was read from a file.

    Attributes
    ----------
    texture : Texture
        What it is here.
    notes : tuple of str
        What was left out, limited or assumed on the way.
    """

    texture: Texture
    notes: tuple[str, ...] = ()


def load_texture(
    path: str | Path,
    speed_mm_s: float | None = None,
    sample_rate_hz: float | None = None,
    scale_n: float | None = None,
    *,
    channel: int = 0,
    angle_deg: float = 0.0,
    part_s: tuple[float, float] | None = None,
    node: tuple[float, float] | None = None,
) -> Texture:
    """Read a texture from a file, as `import_texture` does.

    What was left out, limited or assumed is a warning of the logger `frictus`.

    Parameters
    ----------
    path, speed_mm_s, sample_rate_hz, scale_n, channel, angle_deg, part_s, node
        See `import_texture`.

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
    imported = import_texture(
        path,
        speed_mm_s,
        sample_rate_hz,
        scale_n,
        channel=channel,
        angle_deg=angle_deg,
        part_s=part_s,
        node=node,
    )
    for note in imported.notes:
        log.warning("%s: %s", Path(path).name, note)
    return imported.texture


def import_texture(
    path: str | Path,
    speed_mm_s: float | None = None,
    sample_rate_hz: float | None = None,
    scale_n: float | None = None,
    *,
    channel: int = 0,
    angle_deg: float = 0.0,
    part_s: tuple[float, float] | None = None,
    node: tuple[float, float] | None = None,
) -> ImportedTexture:
    """Read a texture from a file; the suffix says which format.

    ``.wav``: PCM of 8, 16, 24 or 32 bits; full scale is ``scale_n`` newtons. ``.csv``: newtons
    times `scale_n`, one column of samples or two columns, time in s and sample; a header line
    may stand first. ``.json``: a texture document as `frictus.textures` describes it.
    ``.ahap``, ``.haptic``, ``.hjif`` and ``.hmpg``: effects, rendered as
    `frictus.effect_files` describes it; full scale is ``scale_n`` newtons.
    ``.xml``: one node of a Penn HaTT model, see `frictus.hatt`.

    A recording or effect becomes a `Profile` that repeats without end, over position where its
    speed is given, otherwise over time. Its mean is removed, since friction is relative: the
    rig adds the bias it needs. Where the last sample does not lead on to the first, the seam is
    felt once per period. A WAV of more than 65536 samples is resampled, and a note says below
    which speed of the finger detail is missing: of 60 s at 44.1 kHz and 16 mm/s, below 33 mm/s.

    Parameters
    ----------
    path : str or Path
        The file.
    speed_mm_s : float or None
        Speed of the recording, above 0; turns time into position. For an effect the speed at
        which the finger feels it in its own time.
    sample_rate_hz : float or None
        Rate of a one-column CSV; the other recordings bring theirs.
    scale_n : float
        Newtons per unit of the file, not 0; None is 1. Not for JSON, which is in newtons. A
        HaTT model needs it: newtons for each m/s².
    channel : int
        Channel of a WAV file, from 0.
    angle_deg : float
        Direction of a spatial texture's phase, from x towards y. JSON has its own.
    part_s : tuple of float or None
        From when to when of a recording or effect, s; None is all of it. A texture covers at
        most 1000 mm or 10 s.
    node : tuple of float or None
        Speed in mm/s and force in N of the node of a HaTT model; the nearest is taken.

    Returns
    -------
    ImportedTexture
        The texture, and what was left out of it.

    Raises
    ------
    TextureError
        If the file cannot be read as a texture; the text says where and why.
    FileNotFoundError
        If there is no such file.
    """
    path = Path(path)
    factor = 1.0 if scale_n is None else scale_n
    require(factor != 0.0 and math.isfinite(factor), f"scale_n {scale_n}: finite, not 0")
    suffix = path.suffix.lower()
    unused = (speed_mm_s, sample_rate_hz, part_s) != (None, None, None)
    if suffix == ".xml":
        require(not unused, f"{path.name} says its speed and rate: give it none, and no part")
        return _node_of(path, node, scale_n, angle_deg)
    require(node is None, f"{path.name} is no HaTT model (.xml): give it no node")
    if suffix == ".json":
        require(not unused, f"{path.name} is not a recording: give it no speed, rate or part")
        text = read_text(path)
        require(factor == 1.0, f"{path.name} is in newtons: give it no scale")
        require(angle_deg == 0.0, f"{path.name} says its direction: give it no angle")
        try:
            return ImportedTexture(texture_of(text))
        except TextureError as error:
            raise TextureError(f"{path.name}: {error}") from error
    try:
        notes: tuple[str, ...] = ()
        if suffix == ".csv":
            samples, rate_hz = read_csv(path, sample_rate_hz, scale_n is not None)
        else:
            samples, rate_hz, notes = _read_rated(path, suffix, channel)
            if sample_rate_hz is not None and sample_rate_hz != rate_hz:
                raise TextureError(f"it has {rate_hz:g} Hz, not {sample_rate_hz:g} Hz")
        part = _part_of(samples, rate_hz, part_s)
        profile, lost = _profile(factor * part, rate_hz, speed_mm_s, angle_deg)
    except TextureError as error:
        named = str(error).startswith(path.name)
        raise error if named else TextureError(f"{path.name}: {error}") from error
    return ImportedTexture(profile, tuple(map(printable, (*notes, *lost))))


def _node_of(
    path: Path, node: tuple[float, float] | None, scale_n: float | None, angle_deg: float
) -> ImportedTexture:
    """Return the texture of a node of a HaTT model; its label is a note too."""
    require(abs(angle_deg) <= 360.0, f"angle_deg {angle_deg}: -360 to 360")
    try:
        found = import_node(read_text(path), node, scale_n)
    except TextureError as error:
        named = str(error).startswith(path.name)
        raise error if named else TextureError(f"{path.name}: {error}") from error
    return ImportedTexture(found.model_copy(update={"angle_deg": angle_deg}), (found.label,))


def _read_rated(
    path: Path, suffix: str, channel: int
) -> tuple[FloatArray, float, tuple[str, ...]]:
    """Return samples of a file that knows their rate, and what was left out of them."""
    if suffix == ".wav":
        return *read_wav(path, channel), ()
    if suffix in EFFECT_SUFFIXES:
        effect = render_effect(read_bytes(path), suffix)
        require(bool(np.any(effect.signal)), "the effect is silent: there is nothing to feel")
        notes, mean = effect.notes, float(np.mean(effect.signal))
        if abs(mean) > LEAST_MEAN:
            notes += (f"its mean, {mean:.2g} of full scale, is removed: friction is relative",)
        return effect.signal, effect.sample_rate_hz, notes
    raise TextureError(f".wav, .csv, .json, .xml, {', '.join(EFFECT_SUFFIXES)} are accepted")


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
        return adapter.validate_json(text, strict=True, extra="forbid")
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
    profile, notes = _profile(friction_n, sample_rate_hz, speed_mm_s, angle_deg)
    for note in notes:
        log.warning("%s", note)
    return profile


def _profile(
    friction_n: FloatArray, sample_rate_hz: float, speed_mm_s: float | None, angle_deg: float
) -> tuple[Profile, tuple[str, ...]]:
    """Return the profile, and what was left out of it."""
    for name, value in (("sample_rate_hz", sample_rate_hz), ("speed_mm_s", speed_mm_s)):
        positive = value is None or (math.isfinite(value) and value > 0.0)
        require(positive, f"{name} {value}: must be positive and finite")
    count = friction_n.size
    require(count >= 2, f"{count} samples: at least 2 make a texture")
    duration_s = count / sample_rate_hz
    if speed_mm_s is not None:
        require(
            speed_mm_s * duration_s <= PERIOD_MM[1],
            f"period_mm: {duration_s:.3g} s at {speed_mm_s:g} mm/s are "
            f"{speed_mm_s * duration_s:.4g} mm; at most {PERIOD_MM[1]:g} mm, more than any "
            f"screen: give as part_s {PERIOD_MM[1] / speed_mm_s:.3g} s of it",
        )
    else:
        require(
            duration_s <= PERIOD_S[1],
            f"period_s: {duration_s:.4g} s; a texture over time repeats after at most "
            f"{PERIOD_S[1]:g} s: give a part of it (part_s), or its speed",
        )
    require(bool(np.all(np.isfinite(friction_n))), "a sample is not finite")
    centred = friction_n - np.mean(friction_n)
    notes: tuple[str, ...] = ()
    if count > MAX_PROFILE_SAMPLES:
        centred, lost = _resampled(centred, duration_s, speed_mm_s)
        notes = (lost,)
    level = float(np.max(np.abs(friction_n)))
    require(
        float(np.max(np.abs(centred))) > 1e-9 * level,
        "all samples are equal: constant friction is no texture",
    )
    peak_n = float(np.max(np.abs(centred)))
    require(peak_n <= 10.0, f"reaches {peak_n:.3g} N; at most 10 N: give a smaller scale_n")
    try:
        profile = Profile(
            friction_n=centred.tolist(),
            period_mm=None if speed_mm_s is None else speed_mm_s * duration_s,
            period_s=duration_s if speed_mm_s is None else None,
            angle_deg=angle_deg,
        )
        return profile, notes
    except ValidationError as error:
        raise TextureError(explain(error)) from error


def _part_of(
    samples: FloatArray, rate_hz: float, part_s: tuple[float, float] | None
) -> FloatArray:
    if part_s is None:
        return samples
    begin_s, end_s = part_s
    require(
        0.0 <= begin_s < end_s <= samples.size / rate_hz,
        f"part_s {begin_s:g} to {end_s:g} s: rising, within the {samples.size / rate_hz:.4g} s "
        "that were recorded",
    )
    return samples[round(begin_s * rate_hz) : round(end_s * rate_hz)]


def _resampled(
    friction_n: FloatArray, duration_s: float, speed_mm_s: float | None
) -> tuple[FloatArray, str]:
    """Return a period with as many samples as a profile holds, and say what that leaves out."""
    count = MAX_PROFILE_SAMPLES
    spectrum = np.fft.rfft(friction_n)[: count // 2]  # without the line at the new Nyquist
    highest_hz = (count // 2 - 1) / duration_s
    if speed_mm_s is not None:
        lost = f"below {speed_mm_s * BAND_HZ[1] / highest_hz:.2g} mm/s some detail is not felt"
    else:
        lost = f"what is above {highest_hz:.4g} Hz is left out"
    note = f"{friction_n.size} samples became the {count} of a profile: {lost}"
    return np.fft.irfft(spectrum, count) * (count / friction_n.size), note
