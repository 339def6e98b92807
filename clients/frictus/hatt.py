"""One node of a model of the Penn Haptic Texture Toolkit (HaTT), as a spectrum.

The models hold the acceleration of a tool, m/s², that was dragged over a material by hand: for
pairs of speed and normal force (nodes) an autoregressive process, driven by white noise
(Culbertson, Lopez Delgado, Kuchenbecker, Haptics Symposium 2014, p. 319). What friction made
it is not known. So only the shape of the spectrum is taken over, by a scale that somebody
chooses, and every texture made of it says so (`Spectrum.label`).
"""

import math
from dataclasses import dataclass, field
from typing import Final
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from frictus.errors import TextureError
from frictus.sample_files import require
from frictus.textures import BAND_HZ, Component, Spectrum

FloatArray = NDArray[np.float64]

MAX_DEPTH: Final = 10
MAX_ELEMENTS: Final = 500_000
MAX_TEXT: Final = 200
"""Characters of a value."""
MAX_NODES: Final = 10_000
MAX_COEFFICIENTS: Final = 256
PER_OCTAVE: Final = 24
STEP_HZ: Final = 0.25
"""Of the grid on which power is summed."""
LEAST_SHARE: Final = 1e-6
"""Of the strongest component's amplitude; weaker ones are left out."""
ROOT: Final = "modelSet"
_LISTS: Final = ("ARcoeff", "MAcoeff")
_NUMBERS: Final = ("var", "gain", "speedMod", "forceMod")


@dataclass(frozen=True, slots=True)
class HattNode:
    """The process of one speed and force.

    Attributes
    ----------
    speed_mm_s, force_n : float
        At which it was recorded.
    ar : ndarray, shape (n,)
        Coefficients of past outputs, the first 1.
    ma : ndarray, shape (m,)
        Of the noise, gain included.
    variance : float
        Of the noise, (m/s²)².
    """

    speed_mm_s: float
    force_n: float
    ar: FloatArray
    ma: FloatArray
    variance: float

    def power(self, hz: FloatArray, sample_rate_hz: float) -> FloatArray:
        """Return the one-sided power spectral density, (m/s²)²/Hz.

        Parameters
        ----------
        hz : ndarray, shape (n,)
            From 0 to half the sample rate.
        sample_rate_hz : float
            Of the process.
        """
        turn = np.exp(-2j * np.pi * hz / sample_rate_hz)
        gain = np.polynomial.polynomial.polyval(turn, self.ma)
        gain /= np.polynomial.polynomial.polyval(turn, self.ar)
        return np.asarray(2.0 * self.variance / sample_rate_hz * np.abs(gain) ** 2)


@dataclass(frozen=True, slots=True)
class HattModel:
    """A model file.

    Attributes
    ----------
    material : str
        As the file names it.
    sample_rate_hz : float
        Of the processes.
    nodes : tuple of HattNode
        At least one.
    """

    material: str
    sample_rate_hz: float
    nodes: tuple[HattNode, ...]

    def nearest(self, speed_mm_s: float, force_n: float) -> int:
        """Return which node is nearest, speeds and forces in shares of their largest.

        Parameters
        ----------
        speed_mm_s, force_n : float
            Of the node that is looked for; 0 or above.
        """
        at = np.array([(one.speed_mm_s, one.force_n) for one in self.nodes])
        off = (at - (speed_mm_s, force_n)) / at.max(axis=0)
        return int(np.argmin(np.sum(off**2, axis=1)))


def import_node(text: str, node: tuple[float, float] | None, scale_n: float | None) -> Spectrum:
    """Make a texture over position of the node of a model that is nearest.

    Components stand at 1/24-octave steps over 20 to 1000 Hz, each with the power of its band,
    at the node's speed, with phases drawn from a seed that is the node's number.

    Parameters
    ----------
    text : str
        The model file.
    node : tuple of float
        Speed in mm/s and normal force in N.
    scale_n : float
        Newtons of friction for each m/s².

    Raises
    ------
    TextureError
        If the file is none, or no node or scale is given; the text says what there is.
    """
    model = read_hatt(text)
    speeds = [one.speed_mm_s for one in model.nodes]
    forces = [one.force_n for one in model.nodes]
    there = (
        f"{len(model.nodes)} nodes from {min(speeds):.4g} to {max(speeds):.4g} mm/s and "
        f"{min(forces):.3g} to {max(forces):.3g} N"
    )
    if node is None or not all(math.isfinite(value) and value >= 0.0 for value in node):
        raise TextureError(f"it has {there}: say which node, by speed in mm/s and force in N")
    if scale_n is None or not scale_n > 0.0:
        raise TextureError(
            "it holds the acceleration of a tool, not friction: say by scale_n how many "
            "newtons stand for 1 m/s²"
        )
    number = model.nearest(*node)
    found = model.nodes[number]
    hz, amplitude = components_of(found, model.sample_rate_hz)
    kept = amplitude > LEAST_SHARE * amplitude.max()
    reached_n = scale_n * float(np.sum(amplitude[kept]))
    require(
        float(np.max(amplitude)) * scale_n <= 10.0 and math.isfinite(reached_n),
        f"at {scale_n:g} N per m/s² a component has more than 10 N: give a smaller scale_n",
    )
    rms = float(np.sqrt(np.sum(amplitude**2) / 2.0))
    phases = np.random.default_rng(number).uniform(0.0, 2.0 * np.pi, hz.size)
    label = (
        f"acceleration, not friction: Penn HaTT {model.material}, node at "
        f"{found.speed_mm_s:.4g} mm/s and {found.force_n:.3g} N of {there}; {rms:.3g} m/s² rms "
        f"times {scale_n:g} N per m/s²"
    )
    return Spectrum(
        components=[
            Component(amplitude_n=scale_n * a, cycles_per_mm=f / found.speed_mm_s, phase_rad=p)
            for f, a, p in zip(
                hz[kept].tolist(), amplitude[kept].tolist(), phases[kept].tolist(), strict=True
            )
        ],
        label=label,
    )


def components_of(node: HattNode, sample_rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Return sinusoids that have the power of a node, band by band.

    Parameters
    ----------
    node : HattNode
        Of a model.
    sample_rate_hz : float
        Of the model.

    Returns
    -------
    hz, amplitude : ndarray, shape (n,)
        Hz, and m/s².

    Raises
    ------
    TextureError
        If the node is silent there, or not stable.
    """
    named = f"the node at {node.speed_mm_s:.4g} mm/s and {node.force_n:.3g} N"
    require(
        bool(np.all(np.abs(np.roots(node.ar)) < 1.0)),
        f"{named} is not stable, so that it has no spectrum",
    )
    low_hz, high_hz = BAND_HZ[0], min(BAND_HZ[1], sample_rate_hz / 2.0)
    steps = math.ceil(PER_OCTAVE * math.log2(high_hz / low_hz))
    edges = np.geomspace(low_hz, high_hz, steps + 1)
    fine = np.arange(low_hz + STEP_HZ / 2.0, high_hz, STEP_HZ)
    band = np.searchsorted(edges, fine, side="right") - 1
    power = STEP_HZ * np.bincount(band, node.power(fine, sample_rate_hz), steps)
    amplitude = np.sqrt(2.0 * power)
    require(
        bool(np.all(np.isfinite(amplitude)) and np.any(amplitude > 0.0)),
        f"{named} has no finite power from 20 to 1000 Hz",
    )
    return np.sqrt(edges[1:] * edges[:-1]), amplitude


def read_hatt(text: str) -> HattModel:
    """Read a model file.

    Parameters
    ----------
    text : str
        XML with the root `modelSet`, as the toolkit ships it at 10 kHz or resamples it.

    Raises
    ------
    TextureError
        If it is none, declares entities, or has a value out of range.
    """
    reader = _Reader()
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    parser.StartElementHandler = reader.begin
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.characters
    parser.StartDoctypeDeclHandler = _refuse_doctype
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        raise TextureError(f"not an XML document: {error}") from error
    return reader.model()


def _refuse_doctype(*_: object) -> None:
    raise TextureError("it declares a document type; models have none: take that line out")


@dataclass(slots=True)
class _Reader:
    """Keeps what is needed of the elements as they come."""

    texts: dict[str, str] = field(default_factory=dict)
    nodes: list[HattNode] = field(default_factory=list)
    _path: list[str] = field(default_factory=list)
    _elements: int = 0
    _text: str = ""
    _lists: dict[str, list[float]] = field(default_factory=dict)
    _numbers: dict[str, float] = field(default_factory=dict)

    def begin(self, name: str, _attributes: dict[str, str]) -> None:
        self._elements += 1
        require(self._elements <= MAX_ELEMENTS, f"more than {MAX_ELEMENTS} elements")
        require(len(self._path) < MAX_DEPTH, f"elements in elements, {MAX_DEPTH} deep")
        require(
            bool(self._path) or name == ROOT, f"<{name[:40]}> is no <{ROOT}>: not a HaTT model"
        )
        self._path.append(name)
        self._text = ""

    def characters(self, text: str) -> None:
        self._text = (self._text + text)[: MAX_TEXT + 1]

    def end(self, name: str) -> None:
        path, text = self._path[1:], self._text.strip()
        self._path.pop()
        self._text = ""
        if len(path) == 1 and name != "model":
            self.texts[name[:MAX_TEXT]] = text
        elif path == ["model"]:
            self._end_node()
        elif len(path) == 2 and path[0] == "model" and name in _NUMBERS:
            self._numbers[name] = _number(text, name)
        elif len(path) == 3 and path[0] == "model" and path[1] in _LISTS and name == "value":
            values = self._lists.setdefault(path[1], [])
            values.append(_number(text, path[1]))
            require(
                len(values) <= MAX_COEFFICIENTS,
                f"{path[1]}: more than {MAX_COEFFICIENTS} coefficients",
            )

    def _end_node(self) -> None:
        where = f"model {len(self.nodes) + 1}"
        require(len(self.nodes) < MAX_NODES, f"more than {MAX_NODES} models")
        for name in ("var", "speedMod", "forceMod"):
            require(name in self._numbers, f"{where}: <{name}> is missing")
        speed_mm_s, force_n = self._numbers["speedMod"], self._numbers["forceMod"]
        variance = self._numbers["var"]
        require(1.0 <= speed_mm_s <= 10_000.0, f"{where}: {speed_mm_s:g} mm/s; 1 to 10000")
        require(0.0 < force_n <= 100.0, f"{where}: {force_n:g} N; above 0, to 100")
        require(0.0 <= variance <= 1e9, f"{where}: variance {variance:g}; 0 to 1e9")
        ar = np.array(self._lists.get("ARcoeff", ()))
        ma = np.array(self._lists.get("MAcoeff") or (1.0,))
        require(ar.size > 0 and ar[0] == 1.0, f"{where}: <ARcoeff> must begin with 1")
        if ma.size > 1:
            ma = ma * self._numbers.get("gain", 1.0)
        self.nodes.append(HattNode(speed_mm_s, force_n, ar, ma, variance))
        self._lists.clear()
        self._numbers.clear()

    def model(self) -> HattModel:
        require(bool(self.nodes), "it holds no <model>: nothing of a texture is in it")
        rate_hz = _number(self.texts.get("SampleRate", ""), "SampleRate")
        require(100.0 <= rate_hz <= 1e6, f"SampleRate {rate_hz:g} Hz; 100 to 1e6")
        unit = self.texts.get("SpeedUnits", "mm/s").lower()
        require(
            unit.startswith(("mm", "milli")), f"SpeedUnits {unit[:40]!r}: only mm/s is read"
        )
        material = self.texts.get("material", "")[:60] or "without a name"
        return HattModel(material, rate_hz, tuple(self.nodes))


def _number(text: str, name: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    require(abs(value) <= 1e12, f"<{name}> must be a number, not {text[:40]!r}")
    return value
