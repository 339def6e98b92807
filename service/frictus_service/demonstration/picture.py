"""The demo's picture: target, compensated and uncompensated spectrum."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from frictus_service.demonstration.comparison import BandComparison
from frictus_service.fidelity.bands import JND_DB, NOMINAL_HZ, rms_db

LABELS = [f"{centre:g}" for centre in NOMINAL_HZ]


def draw(comparison: BandComparison, texture: str, path: Path) -> None:
    """Draw the spectra and the errors; the suffix of the path says the format.

    Parameters
    ----------
    comparison : BandComparison
        Wanted, felt and uncompensated powers.
    texture : str
        Its name, for the title.
    path : Path
        Of the file.
    """
    figure = Figure(figsize=(9, 6), layout="constrained")
    spectra, errors = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    at = np.arange(len(NOMINAL_HZ))
    spectra.plot(at, _level_db(comparison.target), "k-", lw=2.5, label="asked for")
    spectra.plot(at, _level_db(comparison.compensated), "o-", color="C0", label="felt")
    spectra.plot(
        at, _level_db(comparison.uncompensated), "s--", color="C1", label="not compensated"
    )
    spectra.set_ylabel("friction, dB re 1 mN")
    spectra.set_title(f"'{texture}' under a freely moving finger (simulated rig)")
    spectra.legend()
    errors.axhspan(-JND_DB, JND_DB, color="0.9", label=f"difference threshold, {JND_DB} dB")
    errors.bar(
        at - 0.2,
        comparison.compensated_db,
        0.4,
        color="C0",
        label=f"felt, {rms_db(comparison.compensated_db):.2f} dB rms",
    )
    errors.bar(
        at + 0.2,
        comparison.uncompensated_db,
        0.4,
        color="C1",
        label=f"not compensated, {rms_db(comparison.uncompensated_db):.2f} dB rms",
    )
    errors.set_ylabel("error, dB")
    errors.set_xlabel("third-octave band, Hz")
    errors.set_xticks(at, LABELS)
    errors.legend(fontsize="small", ncols=3)
    for axes in (spectra, errors):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)


def _level_db(power: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float]:
    return [float(10.0 * np.log10(max(value, 1e-30) / 1e-6)) for value in power]
