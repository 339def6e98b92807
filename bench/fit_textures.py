"""Fit the shipped textures to recordings: `python bench/fit_textures.py RECORDINGS_FOLDER`.

Each recording of friction (one column of newtons at 20 kHz, 0.2 s, finger at 40 mm/s) becomes
the amplitudes of about a dozen lines per octave, all multiples of one in 32 mm; phases are
random. The recordings themselves stay where they are.
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from frictus.textures import Component, Spectrum
from frictus_service.durable import replace_files

RATE_HZ = 20_000.0
SPEED_MM_S = 40.0
LINES_PER_OCTAVE = 12
LOW_HZ, HIGH_HZ = 25.0, 1000.0
PERIOD_MM = 32.0
OUT = Path(__file__).parents[1] / "service" / "frictus_service" / "textures"


def fit(friction_n: NDArray[np.float64], rng: np.random.Generator) -> Spectrum:
    """Return lines that carry the power of the recording around each of them."""
    spectrum = (
        np.square(np.abs(np.fft.rfft(friction_n - friction_n.mean()))) / friction_n.size**2
    )
    frequency = np.fft.rfftfreq(friction_n.size, 1.0 / RATE_HZ)
    steps = int(np.log2(HIGH_HZ / LOW_HZ) * LINES_PER_OCTAVE) + 1
    wanted = LOW_HZ * 2.0 ** (np.arange(steps) / LINES_PER_OCTAVE)
    lines_hz = np.unique(np.rint(wanted / SPEED_MM_S * PERIOD_MM)) / PERIOD_MM * SPEED_MM_S
    edges = np.sqrt(lines_hz[1:] * lines_hz[:-1])
    power = 2.0 * np.bincount(np.searchsorted(edges, frequency), spectrum, lines_hz.size)
    return Spectrum(
        components=[
            Component(
                amplitude_n=float(f"{np.sqrt(2.0 * line_power):.4g}"),
                cycles_per_mm=float(hz / SPEED_MM_S),
                phase_rad=float(f"{rng.uniform(0.0, 2.0 * np.pi):.4f}"),
            )
            for hz, line_power in zip(lines_hz, power, strict=True)
            if line_power > 0.0
        ]
    )


def flat(rng: np.random.Generator) -> Spectrum:
    """Return equal lines from 30 to 1000 Hz whatever the speed."""
    return Spectrum(
        components=[
            Component(
                amplitude_n=0.005,
                hz=float(hz),
                phase_rad=float(f"{rng.uniform(0.0, 2.0 * np.pi):.4f}"),
            )
            for hz in range(30, 1001, 5)
        ]
    )


def main() -> None:
    """Write one JSON file per recording, and the flat texture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path)
    folder = parser.parse_args().recordings
    OUT.mkdir(exist_ok=True)
    rng = np.random.default_rng(40)
    textures = {"flat": flat(rng)}
    for path in sorted(folder.glob("*_filt.csv")):
        name = path.stem.removesuffix("_filt").lower()
        textures[name] = fit(np.loadtxt(path), rng)
    documents = {}
    for name, texture in textures.items():
        text = texture.model_dump_json(exclude_defaults=False, exclude_none=True)
        documents[OUT / f"{name}.json"] = f"{text}\n".encode()
    replace_files(documents)


if __name__ == "__main__":
    main()
