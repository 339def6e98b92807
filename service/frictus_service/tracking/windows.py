"""Windows of a tenth of a second of what is played and felt, as sums of spectra in bands.

Half overlapping, while the finger slides steadily: 10 to 150 mm/s, one direction. All that a
law is judged by are the powers and the cross-spectrum of drive and friction in bands of a sixth
of an octave (Bendat and Piersol, Random Data, chapter 6: H1), both through the mount, as the
force sensor has them.
"""

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics.linear import TransferFunction
from frictus_service.calibration.coordinates import HIGH_MM_S, LOW_MM_S
from frictus_service.discovery.evidence.bands import WINDOW_S, Bands
from frictus_service.discovery.evidence.window_spectra import tapered
from frictus_service.identification.observation.response import advance, drive_fraction, hold
from frictus_service.identification.observation.through_mount import ThroughMount
from frictus_service.tracking.band_frequencies import frequencies, shifted

SPEEDS_MM_S: Final = (10.0, 150.0)
PRESSED_N: Final = 0.05
"""Below it the finger is taken to be off the screen."""
PIECES: Final = 10
"""Of a window, in each of which the finger presses: one that is off the screen for a part of it
feels as much less of the drive."""
MOST_ACCELERATED: Final = 1.5
"""Largest over smallest speed of a window."""
STRAIGHT: Final = 0.9
"""Least cosine between the motion at any sample and that of the whole window."""
LEAST_DRIVE: Final = 0.01
"""Standard deviation of the drive fraction within the bands."""
AT_ITS_END: Final = 0.02
"""Share of a window in which the force may have its largest value, or its smallest: one that is
clipped or stuck has it for longer. With noise of a few steps of the converter a sound one has
either in one sample of a thousand."""
STREAMS: Final = ("force", "voltage", "render")
DRIVE: Final = "drive"
"""Drive fraction, and the same through the mount, beside the streams that are given."""
MAINS_HZ: Final = (50.0, 60.0)
"""Frequencies of the windows, at which a line of the mains is looked for."""
SPOILT: Final = {
    Flag.UNDERRUN: "the drive came too late",
    Flag.OVERRUN: "samples were lost",
    Flag.STALE_SENSOR: "the finger was not seen",
}


@dataclass(frozen=True, slots=True)
class LawWindow:
    """What one window says of the law; arrays of shape (n_bands,).

    Attributes
    ----------
    first_sample : int
        Device index.
    contact : int
        Number of the contact it belongs to, rising with each touch.
    speed_mm_s : float
        Mean over the window, without sign; each sample within the range in which laws hold.
    normal_force_n : float
        Mean over the window.
    drive_power : ndarray
        Of the drive fraction through the mount, summed over the frequencies of a band.
    cross : ndarray of complex
        Its conjugate times the force, summed likewise, N.
    friction_power : ndarray
        Of the force, N².
    position_mm : float
        Mean along x, from the left edge of the screen.
    direction : float
        +1 left to right, -1 right to left.
    drive_mean, drive_variance : float
        Of the drive fraction.
    minutes : float
        Of its first sample, since the device began.
    frequency_hz : ndarray of complex, optional
        Mean in each band (`band_frequencies`); that of the bands where it is not known.
    mains_n : ndarray of complex, shape (2,)
        Spectrum of the sensor's x at `MAINS_HZ`, the drive's part included, N.
    mains_drive : ndarray of complex, shape (2,)
        Of the drive fraction there.
    band_speed_mm_s : ndarray of complex, optional
        At which the drive of each band was felt, a mean likewise. A texture's line is in a high
        band while the finger is fast; `speed_mm_s` where it is not known.
    frequency_variance_hz2 : ndarray of complex, optional
        In each band; 0 where it is not known.
    """

    first_sample: int
    contact: int
    speed_mm_s: float
    normal_force_n: float
    drive_power: FloatArray
    cross: ComplexArray
    friction_power: FloatArray
    position_mm: float = 35.0
    direction: float = 1.0
    drive_mean: float = 0.5
    drive_variance: float = 0.0
    minutes: float = 0.0
    frequency_hz: ComplexArray | None = None
    mains_n: ComplexArray = field(default_factory=lambda: np.zeros(2, dtype=np.complex128))
    mains_drive: ComplexArray = field(default_factory=lambda: np.zeros(2, dtype=np.complex128))
    band_speed_mm_s: ComplexArray | None = None
    frequency_variance_hz2: ComplexArray | None = None


class WindowCutter:
    """Cuts what a rig publishes into windows, and counts those that cannot be used.

    Parameters
    ----------
    sample_rate_hz : float
        Samples per second of the device's clock.
    screen_peak_v : float
        Screen volts at a drive fraction of 1.
    mount : TransferFunction or None
        Between screen and force sensor, lateral, force to force.

    Attributes
    ----------
    screen_peak_v : float
        Screen volts at a drive fraction of 1.
    bands : Bands
        In which every window speaks.
    mount : TransferFunction or None
        As given.
    contact : int
        Number of the contact at the newest sample, rising with each touch.
    refused : Counter of str
        Windows left out, by the reason.
    """

    def __init__(
        self, sample_rate_hz: float, screen_peak_v: float, mount: TransferFunction | None
    ) -> None:
        self._length = 2 * round(WINDOW_S * sample_rate_hz / 2.0)
        self._rate_hz = sample_rate_hz
        self.screen_peak_v = screen_peak_v
        self.mount = mount
        self.bands = Bands.of(self._length, sample_rate_hz, mount)
        frequency_hz = self.bands.frequency_hz
        self._line = np.rint(frequency_hz * self._length / sample_rate_hz).astype(np.int64)
        self._mains = np.searchsorted(frequency_hz, MAINS_HZ)
        self._first_line = np.flatnonzero(np.diff(self.bands.band, prepend=-1))
        around = np.arange(self._length) - self._length // 20
        span = np.stack([around, around + self._length // 10])
        self._span = np.clip(span, 0, self._length - 1)
        self._hold = hold(frequency_hz, sample_rate_hz)
        self._mounted = ThroughMount(mount, sample_rate_hz)
        self.skew(0.0)
        self._parts: list[AlignedSamples] = []
        self._used = 0  # samples of the first part
        self._held = 0
        self._run: int | None = None
        self.contact = 0
        self.refused: Counter[str] = Counter()

    def skew(self, force_skew_s: float) -> None:
        """Take the force from now on as sampled later than the voltage.

        Parameters
        ----------
        force_skew_s : float
            By so much; 0 for a rig, as after construction.
        """
        late = advance(self.bands.frequency_hz, force_skew_s)
        self._passing = self._hold * self.bands.passing * late
        self._passing_per_hz = np.gradient(self._passing, self.bands.frequency_hz)

    def take(self, part: AlignedSamples) -> list[LawWindow]:
        """Take samples and return the windows that they complete.

        Parameters
        ----------
        part : AlignedSamples
            Of the streams `STREAMS`.
        """
        if part.run != self._run or part.missing_samples:
            if part.run == self._run:
                self.refused["samples are missing"] += 1
            else:
                self.contact += 1
            self._run, self._parts, self._used, self._held = part.run, [], 0, 0
            self._mounted.begin()
        drive = drive_fraction(part.data["voltage"][0].astype(np.float64), self.screen_peak_v)
        passed = self._mounted.take(drive[:, np.newaxis])[:, 0]
        both = np.stack([drive, passed]).astype(np.float32)
        self._parts.append(replace(part, data={**part.data, DRIVE: both}))
        self._held += part.data["force"].shape[1]
        found = []
        while self._held >= self._length:
            window = self._window()
            if window is not None:
                found.append(window)
            self._drop(self._length // 2)
        return found

    def _drop(self, n_samples: int) -> None:
        self._held -= n_samples
        self._used += n_samples
        while self._parts and self._used >= (size := self._parts[0].data["force"].shape[1]):
            self._used -= size
            del self._parts[0]

    def _window(self) -> LawWindow | None:
        first = self._parts[0].first_sample + self._used
        flags = Flag(0)
        for part in self._parts:
            flags |= part.flags
        data = {
            name: np.concatenate([part.data[name] for part in self._parts], axis=1)[
                :, self._used : self._used + self._length
            ].astype(np.float64)
            for name in (*STREAMS, DRIVE)
        }
        reason = self._spoilt(flags, data) or _unsteady(data["render"][:3])
        if not reason:
            along = self._direction(data["render"][:2])
            reason = _turning(along) or _ended(data["force"], along)
        if reason:
            self.refused[reason] += 1
            return None
        return self._spectra(first, data, along)

    def _spoilt(self, flags: Flag, data: dict[str, FloatArray]) -> str:
        for flag, reason in SPOILT.items():
            if flags & flag:
                return reason
        used = (data["force"], data[DRIVE], data["render"][:3])
        if not all(np.isfinite(rows).all() for rows in used):
            return "samples are not numbers"
        pieces = np.array_split(data["force"][2], PIECES)
        if min(piece.mean() for piece in pieces) < PRESSED_N:
            self.contact += 1
            return "no finger presses"
        return ""

    def _direction(self, position_mm: FloatArray) -> FloatArray:
        """Return the unit vector along the motion at every sample, shape (2, n_samples).

        Over a tenth of the window: where a prediction is corrected the rendered position jumps
        from one block to the next, often backwards, and the finger does not.
        """
        before, after = self._span
        step = position_mm[:, after] - position_mm[:, before]
        along: FloatArray = step / np.maximum(np.hypot(step[0], step[1]), 1e-12)
        return along

    def _spectra(
        self, first_sample: int, data: dict[str, FloatArray], along: FloatArray
    ) -> LawWindow | None:
        friction = np.sum(data["force"][:2] * along, axis=0)
        drive, passed = data[DRIVE]
        within = np.clip(data["render"][2], LOW_MM_S, HIGH_MM_S)
        slowest, mean, fastest = within.min(), within.mean(), within.max()
        sensed = (drive, passed, friction, data["force"][0], *shifted(passed))
        channels = tapered(np.stack(sensed))
        channels = np.vstack([channels, channels[1] * (within - mean)])
        spectra = np.fft.rfft(channels, axis=-1)[:, self._line]
        driven, mounted, felt, _, earlier, later, faster = spectra
        driven_power = np.square(np.abs(driven * self._hold)).sum()
        if np.sqrt(2.0 * driven_power / self._length) < LEAST_DRIVE:
            self.refused["nothing is played"] += 1
            return None
        power = self._sum(np.square(np.abs(mounted))).real
        each = 1.0 / np.maximum(power, np.finfo(float).tiny)
        back, forth = (self._sum(mounted.conj() * other) for other in (earlier, later))
        at_hz, variance_hz2 = frequencies(self.bands, power, back, forth, self._rate_hz)
        # A law is nearly linear in the speed over a window, and what counts of the speed is its
        # mean over the drive's energy.
        above = self._sum(mounted.conj() * faster) * each
        most = (fastest - slowest) / 2.0
        at_mm_s = np.clip(mean + above.real, slowest, fastest)
        passing, per_hz = (
            np.interp(at_hz.real, self.bands.frequency_hz, table)
            for table in (self._passing, self._passing_per_hz)
        )
        passing = passing + 1j * at_hz.imag * per_hz
        return LawWindow(
            first_sample,
            self.contact,
            float(mean),
            float(data["force"][2].mean()),
            power * np.square(np.abs(passing)),
            self._sum(mounted.conj() * felt) * passing.conj(),
            self._sum(np.square(np.abs(felt))).real,
            position_mm=float(data["render"][0].mean()),
            direction=float(np.sign(along[0].mean())),
            drive_mean=float(drive.mean()),
            drive_variance=2.0 * float(driven_power) / self._length,
            minutes=first_sample / self._rate_hz / 60.0,
            frequency_hz=at_hz,
            mains_n=spectra[3, self._mains],
            mains_drive=(mounted * self._passing)[self._mains] * along[0].mean(),
            band_speed_mm_s=at_mm_s + 1j * np.clip(above.imag, -most, most),
            frequency_variance_hz2=variance_hz2,
        )

    def _sum(self, spectrum: ComplexArray | FloatArray) -> ComplexArray:
        summed: ComplexArray = np.add.reduceat(spectrum, self._first_line).astype(complex)
        return summed


def _unsteady(motion: FloatArray) -> str:
    if not motion.any(axis=0).all():  # as `touch_path` has it
        return "touch reports tell no smooth motion"
    speed = motion[2]
    slowest, fastest = float(speed.min()), float(speed.max())
    if slowest < SPEEDS_MM_S[0] or fastest > SPEEDS_MM_S[1]:
        return f"slower than {SPEEDS_MM_S[0]:g} or faster than {SPEEDS_MM_S[1]:g} mm/s"
    return "the speed changes too much" if fastest > MOST_ACCELERATED * slowest else ""


def _turning(along: FloatArray) -> str:
    whole = along.mean(axis=1)
    least = STRAIGHT * float(np.hypot(*whole))
    return "the finger turns" if float((along.T @ whole).min()) < least else ""


def _ended(force_n: FloatArray, along: FloatArray) -> str:
    """Return whether the force along the motion stands still or at an end of its range."""
    felt = force_n[int(np.argmax(np.abs(along.mean(axis=1))))]
    longest = max(np.mean(felt == felt.max()), np.mean(felt == felt.min()))
    return "the force stands still, or at an end of its range" if longest > AT_ITS_END else ""
