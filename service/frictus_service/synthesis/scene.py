"""What is played, compiled: a scene, the scene behind a stream, or an excitation.

The drive fraction must stay in [0, 1] wherever the finger is and however fast it moves. What a
layer asks of the drive is found by rendering it at every point and speed; the scene is then
scaled, once and for all speeds, and the scale is reported.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus.errors import ArgumentError, TextureError
from frictus.messages import Applied, Excitation
from frictus.stream import StreamFrame
from frictus.textures import Scene
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis import kernel
from frictus_service.synthesis.compensation import Inverse, Invertible, as_inverse
from frictus_service.synthesis.components import periodic
from frictus_service.synthesis.drive_range import SPEEDS_MM_S, reach_of
from frictus_service.synthesis.layers import Layer, arrays_of, layers_of, single_table
from frictus_service.synthesis.tables import TOP_HZ, build_table

MAX_FREE_TONES: Final = 32
"""Without a period each tone costs time in every sample; with one, none does."""
ROUNDING: Final = 1e-6


@dataclass(frozen=True, slots=True)
class CompiledExcitation:
    """What the renderer plays; ``m[n] = table[n mod period] + sum of tones``.

    Attributes
    ----------
    table : ndarray, shape (n_period,)
        One period, bias included; of one sample where there is no period.
    hz, amplitude, phase_rad : ndarray, shape (n_tones,)
        The tones, where there is no period.
    peak : float
        Largest drive fraction.
    applied : Applied
        The bias; the gain of what is played as it is is 1.
    source : str
        Etag of what was asked for.
    """

    table: FloatArray
    hz: FloatArray
    amplitude: FloatArray
    phase_rad: FloatArray
    peak: float
    applied: Applied
    source: str = "excitation"


def compile_excitation(
    excitation: Excitation, law: FrictionLaw, sample_rate_hz: float
) -> CompiledExcitation:
    """Return an excitation ready to play.

    Parameters
    ----------
    excitation : Excitation
        The tones to play.
    law : FrictionLaw
        Tells the friction that the bias adds; nothing else depends on it.
    sample_rate_hz : float

    Raises
    ------
    ArgumentError
        If the drive leaves [0, 1], a tone is at or above half of the sample rate or no multiple
        of 1 / period, or there are too many tones for one without a period.
    """
    tones = excitation.tones
    hz = np.array([tone.hz for tone in tones])
    amplitude = np.array([tone.amplitude for tone in tones])
    phase = np.array([tone.phase_rad for tone in tones])
    if hz.size and not float(hz.max()) < sample_rate_hz / 2.0:
        raise ArgumentError(
            f"a tone of {hz.max():g} Hz at {sample_rate_hz:g} samples per second: "
            "below half of it is accepted"
        )
    if excitation.period_s is None:
        if hz.size > MAX_FREE_TONES:
            raise ArgumentError(
                f"{hz.size} tones without period_s: up to {MAX_FREE_TONES} accepted; "
                "give the period of their sum"
            )
        table = np.array([excitation.bias])
        swing = float(amplitude.sum())
        low, high = excitation.bias - swing, excitation.bias + swing
    else:
        table = excitation.bias + _period(
            hz, amplitude, phase, excitation.period_s, sample_rate_hz
        )
        hz = amplitude = phase = np.zeros(0)
        low, high = float(table.min()), float(table.max())
    if not (low >= -ROUNDING and high <= 1.0 + ROUNDING):
        raise ArgumentError(
            f"the drive goes from {low:.4g} to {high:.4g}: it must stay within 0 to 1; "
            "lower the amplitudes or move the bias"
        )
    applied = Applied(
        gain=1.0,
        feasible_gain=1.0,
        bias=excitation.bias,
        bias_n=excitation.bias * law.gain_n,
        scaled=False,
        speed_range_mm_s=(0.0, float(SPEEDS_MM_S[-1])),
    )
    return CompiledExcitation(table, hz, amplitude, phase, min(high, 1.0), applied)


def _period(
    hz: FloatArray,
    amplitude: FloatArray,
    phase_rad: FloatArray,
    period_s: float,
    sample_rate_hz: float,
) -> FloatArray:
    """Return one period of the sum of tones, by the inverse transform of its lines."""
    n = round(period_s * sample_rate_hz)
    if n < 1 or abs(n - period_s * sample_rate_hz) > ROUNDING * n:
        raise ArgumentError(
            f"period_s {period_s:g} is {period_s * sample_rate_hz:.6g} samples at "
            f"{sample_rate_hz:g} per second: a whole number is accepted"
        )
    line = np.rint(hz * n / sample_rate_hz).astype(np.int64)
    off = np.abs(line * sample_rate_hz / n - hz)
    if np.any(off > ROUNDING * hz):
        worst = int(np.argmax(off))
        raise ArgumentError(
            f"a tone of {hz[worst]:g} Hz is no multiple of {sample_rate_hz / n:g} Hz, "
            f"1 / period_s"
        )
    spectrum = np.zeros(n // 2 + 1, dtype=np.complex128)
    np.add.at(spectrum, line, 0.5 * n * amplitude * np.exp(1j * phase_rad))
    return np.fft.irfft(spectrum, n)


HEADROOM = 0.03
"""Share of the drive kept free for cross-fades and corrections of the finger's motion."""
MAX_SCENE_BYTES = 200_000_000
"""Of the tables of all its layers: five of the largest."""


@dataclass(frozen=True, slots=True)
class CompiledScene:
    """What the renderer plays.

    Attributes
    ----------
    arrays : SceneArrays
        For the kernel, gain and bias included.
    applied : Applied
        What became of the request.
    source : str
        `scene` or `stream`.
    """

    arrays: kernel.SceneArrays
    applied: Applied
    source: str = "scene"

    @property
    def size_bytes(self) -> int:
        """What its arrays take."""
        return sum(array.nbytes for array in self.arrays if isinstance(array, np.ndarray))


def compile_scene(
    scene: Scene,
    law: Invertible,
    screen: Screen,
    sample_rate_hz: float,
    check: Callable[[], None] = lambda: None,
) -> CompiledScene:
    """Compile a scene for a screen and a friction law.

    Parameters
    ----------
    scene : Scene
        As a client sent it.
    law : FrictionLaw or Inverse
        What will be undone: it sets what the drive can reach.
    screen : Screen
        Its peak voltage, carrier and size.
    sample_rate_hz : float
        Samples per second of the device's clock.
    check : callable
        Called before each texture is compiled, and before its range is found; may raise, to
        give up.

    Returns
    -------
    CompiledScene
        `applied.gain` is below 1 where the scene was scaled to fit.

    Raises
    ------
    TextureError
        If a texture cannot be represented, or all together would not fit into memory; the
        text names the region.
    """
    layers: list[Layer] = []
    size_bytes = 0
    for number, region in enumerate(scene.regions):
        check()
        try:
            coming = layers_of(region, screen)
            size_bytes += sum(layer.size_bytes for layer in coming)
            if size_bytes > MAX_SCENE_BYTES:
                raise TextureError(
                    f"with those before it, its tables take {size_bytes / 1e6:.0f} MB; at most "
                    f"{MAX_SCENE_BYTES / 1e6:.0f} MB are kept. Take fewer textures, or lower "
                    "their highest frequencies"
                )
            layers += coming
        except TextureError as error:
            named = f"regions.{number} {region.name}".rstrip()
            raise TextureError(f"{named}: {error}") from error
    arrays = arrays_of(layers)
    inverse = as_inverse(law)
    low, high = reach_of(layers, arrays, inverse.bounding, sample_rate_hz, check)
    return fit(arrays, low, high, inverse, [note for layer in layers for note in layer.notes])


def fit(
    arrays: kernel.SceneArrays,
    low: float,
    high: float,
    inverse: Inverse,
    notes: list[str],
    source: str = "scene",
) -> CompiledScene:
    """Scale layers so that what they ask of the bounding law, `low` to `high`, fits."""
    law, low, high = inverse.bounding, inverse.swing * low, inverse.swing * high
    swing = high - low
    feasible = 1.0 / swing if swing > 0.0 else np.inf
    gain = min(1.0, (1.0 - HEADROOM) * feasible)
    bias = -gain * low + HEADROOM / 2.0 if swing > 0.0 else 0.0
    real = arrays.real.copy()
    real[:, kernel.GAIN] *= gain
    applied = Applied(
        gain=gain,
        feasible_gain=min(feasible, 1e9),
        bias=bias,
        bias_n=bias * law.gain_n,
        scaled=gain < 1.0,
        speed_range_mm_s=(0.0, float(SPEEDS_MM_S[-1])),
        notes=notes,
    )
    return CompiledScene(arrays._replace(real=real, bias_n=bias * law.gain_n), applied, source)


@dataclass(frozen=True, slots=True)
class StreamBudget:
    """What the updates of one stream may ask of the drive.

    A texture that is limited to the band and never exceeds the declared peak P asks for at
    most ``P sqrt(1 + (f_top / f_c)^2) / g`` of drive (Bernstein's inequality), whatever its
    shape, so that the bias and the gain need not change with the updates.

    Attributes
    ----------
    peak_n : float
        Declared peak of every update, its mean taken off, N.
    inverse : Inverse
        What is undone.
    quiet : CompiledScene
        What is felt before the first update and when updates stop: the bias alone.
    """

    peak_n: float
    inverse: Inverse
    quiet: CompiledScene

    @classmethod
    def open(cls, peak_n: float, law: Invertible) -> "StreamBudget":
        """Return the budget of a stream with the declared peak, N."""
        nothing = single_table(
            build_table(periodic(np.array([0.0, 1e-12]), 1.0, True, 0.0), (0.0, 1.0)), True, 0.0
        )
        inverse = as_inverse(law)
        reach = _reach(peak_n, inverse.bounding)
        return cls(peak_n, inverse, fit(nothing, -reach, reach, inverse, [], "stream"))

    @property
    def applied(self) -> Applied:
        """Gain and bias of every update."""
        return self.quiet.applied

    def compile(self, frame: StreamFrame) -> CompiledScene:
        """Compile one update; constant friction is silence.

        Raises
        ------
        TextureError
            If the update exceeds the declared peak or cannot be represented.
        """
        if np.all(frame.friction_n == frame.friction_n[0]):
            return self.quiet
        friction_n = frame.friction_n.astype(float)
        components = periodic(friction_n, frame.period, frame.spatial, frame.angle_deg)
        table = build_table(components, (0.0, frame.period))
        peak = max(float(np.abs(rows).max()) for rows in table.octaves)
        if not peak <= self.peak_n * (1.0 + 1e-3):
            sent_n = float(np.abs(friction_n).max())
            centred_n = float(np.abs(friction_n - friction_n.mean()).max())
            skewed = sent_n <= self.peak_n * (1.0 + 1e-6) < centred_n
            where = "less its mean" if skewed else "between its samples"
            raise TextureError(
                f"friction reaches {peak:.4g} N {where}, "
                f"the stream declared {self.peak_n:.4g} N; open it with a larger peak"
            )
        arrays = single_table(table, frame.spatial, frame.angle_deg)
        reach = _reach(self.peak_n, self.inverse.bounding)
        return fit(arrays, -reach, reach, self.inverse, [], "stream")


def _reach(peak_n: float, law: FrictionLaw) -> float:
    slowest = float(np.min(cutoff_hz(law, np.array(law.speed_range_mm_s))))
    return peak_n * float(np.sqrt(1.0 + (TOP_HZ / slowest) ** 2)) / law.gain_n
