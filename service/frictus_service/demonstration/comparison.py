"""What the demo's finger felt, beside the target and without compensation, and its picture."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from frictus.stream import StreamFrame
from frictus.textures import Profile
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, motion_fade
from frictus_hardware.physics.stages import standard_twin
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_service.demonstration.explorer import PERIOD_MM, Heard, peak_of
from frictus_service.fidelity.measure import feel
from frictus_service.fidelity.path import exact_friction, walk
from frictus_service.fidelity.preview import (
    JND_DB,
    NOMINAL_HZ,
    band_power,
    error_db,
    rms_db,
    windows,
)
from frictus_service.synthesis.compensation import uncompensated
from frictus_service.synthesis.components import components_of
from frictus_service.synthesis.scene import StreamBudget

WINDOW_SAMPLES = 8192


class DemoError(RuntimeError):
    """The demo cannot be judged; the text says why."""


@dataclass(frozen=True, slots=True)
class BandComparison:
    """Powers in third octaves, shape (16,), N².

    Attributes
    ----------
    target, compensated, uncompensated : ndarray
        Asked for; felt live; and felt on the same path had the drive not followed the speed.
    """

    target: FloatArray
    compensated: FloatArray
    uncompensated: FloatArray

    @property
    def compensated_db(self) -> FloatArray:
        """Level error in each band, NaN where too weak to judge."""
        return error_db(self.compensated, self.target)

    @property
    def uncompensated_db(self) -> FloatArray:
        """The same without compensation."""
        return error_db(self.uncompensated, self.target)


def compare(
    heard: Heard,
    friction_n: FloatArray,
    law: FrictionLaw,
    config: SimulatedConfig,
) -> BandComparison:
    """Judge what was felt live, and what would have been felt without compensation.

    The simulated finger's way is a function of the device's time alone, so it can be walked
    again; that it is the same way is checked.

    Parameters
    ----------
    heard : Heard
        What the subscriber received.
    friction_n : ndarray, shape (n_samples,)
        One period, as streamed.
    law : FrictionLaw
        The rig's active law.
    config : SimulatedConfig

    Raises
    ------
    DemoError
        If too little was heard, or the finger's way was another.
    """
    rate = config.sample_rate_hz
    n_samples = heard.truth.shape[1]
    segments = [
        part
        for part in windows(n_samples, WINDOW_SAMPLES)
        if np.all(np.isfinite(heard.truth[:, part]))
    ]
    if not segments:
        raise DemoError("too many blocks were lost to judge what was felt; see the counters")
    position = heard.truth[:2].T.astype(float)
    speed = np.hypot(heard.truth[2], heard.truth[3]).astype(float)
    profile = Profile(friction_n=friction_n.tolist(), period_mm=PERIOD_MM)
    asked = exact_friction(components_of(profile), np.nan_to_num(position), 0, rate)
    target = (heard.applied.bias_n + heard.applied.gain * asked) * motion_fade(
        np.nan_to_num(speed)
    )
    path = walk(config, (heard.first_sample + n_samples) / rate)
    again = path.position_mm[heard.first_sample : heard.first_sample + n_samples]
    apart = float(np.nanmax(np.abs(position - again)))
    if not apart < 0.01:
        raise DemoError(f"the finger's way differs by {apart:g} mm when walked again")
    frame = StreamFrame(0, 0, 0, 0, PERIOD_MM, True, 0.0, friction_n.astype(np.float32))
    scene = StreamBudget.open(peak_of(friction_n), law).compile(frame)
    twin = standard_twin(config.screen, config.participant.law)
    bare, _ = feel(path, scene, uncompensated(law), config.screen, twin)
    without = bare.friction_n[heard.first_sample : heard.first_sample + n_samples]
    return BandComparison(
        band_power(target, rate, segments),
        band_power(heard.truth[4].astype(float), rate, segments),
        band_power(without, rate, segments),
    )


LABELS = [f"{centre:g}" for centre in NOMINAL_HZ]


def draw(asked: FloatArray, felt: Mapping[str, FloatArray], title: str, path: Path) -> None:
    """Draw the spectra and the errors; the suffix of the path says the format.

    Parameters
    ----------
    asked : ndarray, shape (16,)
        Power in third octaves, N².
    felt : mapping of str to ndarray, shape (16,)
        Two of them, by what they are called.
    title : str
        Over the picture.
    path : Path
        Of the file.
    """
    figure = Figure(figsize=(9, 6), layout="constrained")
    spectra, errors = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    at = np.arange(len(NOMINAL_HZ))
    spectra.plot(at, _level_db(asked), "k-", lw=2.5, label="asked for")
    errors.axhspan(-JND_DB, JND_DB, color="0.9", label=f"difference threshold, {JND_DB} dB")
    for number, (name, power) in enumerate(felt.items()):
        colour, off_db = f"C{number}", error_db(power, asked)
        spectra.plot(at, _level_db(power), ("o-", "s--")[number], color=colour, label=name)
        where = at + (-0.2, 0.2)[number]
        label = f"{name}, {rms_db(off_db):.2f} dB rms"
        errors.bar(where, off_db, 0.4, color=colour, label=label)
    spectra.set_ylabel("friction, dB re 1 mN")
    spectra.set_title(title)
    spectra.legend()
    errors.set_ylabel("error, dB")
    errors.set_xlabel("third-octave band, Hz")
    errors.set_xticks(at, LABELS)
    errors.legend(fontsize="small", ncols=3)
    for axes in (spectra, errors):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)


def _level_db(power: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float]:
    return [float(10.0 * np.log10(max(value, 1e-30) / 1e-6)) for value in power]
