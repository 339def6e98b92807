"""The binary form of MPEG haptics (`.hmpg`): its bits become an HJIF document.

A file is a stream of units (ISO/IEC 23090-31, MIHS), a unit a header of 72 bits and packets, a
packet a header of 24 bits and a payload whose length it says. Numbers begin with their highest
bit. Units last some ticks; the effects of their data packets stand in time relative to the
unit's begin, and an effect that goes on in a later unit is named by its number.
"""

from collections.abc import Sequence
from typing import Any, Final

from frictus.effect_files.mpeg import MAX_KEYFRAMES
from frictus.effect_files.wavelets import stream_of
from frictus.errors import TextureError

MAX_PACKETS: Final = 100_000
"""And units, together."""
MAX_EFFECTS: Final = 100_000
_UNIT_BYTES, _PACKET_BYTES = 9, 3
_TIMING, _HAPTICS, _PERCEPTION, _CHANNEL, _BAND, _DATA, _LIBRARY = range(7)
_CHECKS: Final = range(7, 11)
_BEGIN: Final = 11
_MODALITIES: Final = (
    "Other", "Pressure", "Acceleration", "Velocity", "Position", "Temperature", "Vibrotactile",
    "Water", "Wind", "Force", "Vibrotactile Texture", "Stiffness", "Friction", "Electrotactile",
)  # fmt: skip
_OVER_DISTANCE: Final = ("Vibrotactile Texture", "Stiffness", "Friction")
_BANDS: Final = ("Transient", "Curve", "VectorialWave", "WaveletWave")
_CURVES: Final = ("Unknown", "Cubic", "Linear", "Akima", "Bezier", "Bspline")
_SIGNALS: Final = ("Sine", "Square", "Triangle", "SawToothUp", "SawToothDown")
_EFFECTS: Final = ("Basis", "Reference", "Composite")
_POSITION, _AMPLITUDE = "relative_position", "amplitude_modulation"
_FREQUENCY: Final = "frequency_modulation"
_LARGEST: Final = 10_000.0
"""Of gains and mixing coefficients."""
_TURN: Final = 6.28318
Tree = dict[str, Any]


def hjif_of(data: bytes) -> Tree:
    """Return the HJIF document that a binary file stands for.

    Everything that `frictus.effect_files.mpeg.render_hjif` looks at is in it. Descriptions,
    avatars, reference devices, body parts and semantics are passed over, and so are check sums,
    which are not verified, and data of perceptions over distance.

    Parameters
    ----------
    data : bytes
        The file.

    Raises
    ------
    TextureError
        If it ends early, holds a number that stands for nothing, names what it did not
        announce, or is larger than `MAX_PACKETS`, `MAX_EFFECTS` or `MAX_KEYFRAMES` allow.
    """
    stream, at, packets = _Stream(), 0, 0
    while at < len(data):
        unit = _Bits(data[at : at + _UNIT_BYTES], f"the unit at byte {at}")
        unit.named(("initialization", "temporal", "spatial", "silent"), 6, "unit type")
        unit.read(6)
        duration, length = unit.read(24), unit.read(32)
        at += _UNIT_BYTES
        if length > len(data) - at:
            raise TextureError(
                f"{unit.where} has {length} bytes, of which {len(data) - at} are there: the "
                "file is cut, or no MPEG haptics stream (.hmpg)"
            )
        end, packets = at + length, packets + 1
        _check(packets)
        while at < end:
            head = _Bits(data[at : at + _PACKET_BYTES], f"the packet at byte {at}")
            kind, size = head.read(6), head.read(17)
            at += _PACKET_BYTES
            if size > end - at:
                raise TextureError(f"{head.where} is longer than its unit")
            stream.take(kind, _Bits(data[at : at + size], head.where))
            at, packets = at + size, packets + 1
            _check(packets)
        stream.time += duration
    return {"timescale": stream.timescale, "perceptions": list(stream.perceptions.values())}


def _check(packets: int) -> None:
    if packets > MAX_PACKETS:
        raise TextureError(f"more than {MAX_PACKETS} packets and units")


class _Stream:
    """What was read so far."""

    def __init__(self) -> None:
        self.time = 0
        self.timescale = 1_000
        self.perceptions: dict[int, Tree] = {}
        self._channels: dict[tuple[int, int], Tree] = {}
        self._bands: dict[tuple[int, int, int], Tree] = {}
        self._effects: dict[tuple[int, int, int, int], Tree] = {}
        self._keyframes_left, self._effects_left = MAX_KEYFRAMES, MAX_EFFECTS

    def take(self, kind: int, bits: "_Bits") -> None:
        """Read the payload of a packet."""
        if kind == _TIMING:
            self.time = bits.read(32)
        elif kind == _BEGIN:
            self.time, self.timescale = bits.read(32), bits.read(32)
        elif kind == _PERCEPTION:
            self._take_perception(bits)
        elif kind == _CHANNEL:
            self._take_channel(bits)
        elif kind == _BAND:
            self._take_band(bits)
        elif kind == _LIBRARY:
            self._take_library(bits)
        elif kind == _DATA:
            self._take_data(bits)
        elif kind != _HAPTICS and kind not in _CHECKS:
            raise TextureError(f"{bits.where} is of type {kind}; 0 to {_BEGIN} are read")

    def _take_perception(self, bits: "_Bits") -> None:
        number = bits.read(8)
        bits.read(8)
        bits.skip_text()
        modality = bits.named(_MODALITIES, 8, "modality")
        bits.read(8 + 16)
        if bits.read(1):
            bits.skip_text()
        bits.read(8)
        # Metadata are repeated where a stream can be entered.
        found = self.perceptions.setdefault(number, {"effect_library": [], "channels": []})
        found |= {"perception_modality": modality, "perception_unit_exponent": bits.signed(8)}

    def _take_channel(self, bits: "_Bits") -> None:
        number, of = bits.read(16), bits.read(8)
        bits.read(8)
        bits.skip_text()
        bits.read(8)
        gain, mixed = bits.share(32, -_LARGEST, _LARGEST), bits.share(32, 0.0, _LARGEST)
        perception = _announced(self.perceptions, of, f"{bits.where}: perception {of}")
        if (of, number) not in self._channels:
            self._channels[of, number] = {"bands": []}
            perception["channels"].append(self._channels[of, number])
        self._channels[of, number] |= {"gain": gain, "mixing_coefficient": mixed}

    def _take_band(self, bits: "_Bits") -> None:
        number, of, channel_of = bits.read(8), bits.read(8), bits.read(16)
        bits.read(8)
        kind = bits.named(_BANDS, 3, "band type")
        curve = bits.named(_CURVES, 4, "curve type") if kind == "Curve" else "Unknown"
        block = bits.read(8) if kind == "WaveletWave" else 0
        bits.read(16)
        made = {
            "band_type": kind,
            "curve_type": curve,
            "block_length": block,
            "upper_frequency_limit": bits.read(16),
        }
        key = (of, channel_of)
        channel = _announced(self._channels, key, f"{bits.where}: channel {channel_of}")
        if (*key, number) not in self._bands:
            self._bands[*key, number] = {"effects": []}
            channel["bands"].append(self._bands[*key, number])
        self._bands[*key, number] |= made

    def _take_library(self, bits: "_Bits") -> None:
        of = bits.read(8)
        perception = _announced(self.perceptions, of, f"{bits.where}: perception {of}")
        for _ in range(bits.read(16)):
            effect: Tree = {"id": bits.read(16)}
            effect["effect_type"] = bits.named(_EFFECTS, 2, "effect type")
            bits.skip_semantic()
            bits.read(25)
            if effect["effect_type"] == "Basis":
                effect |= bits.shape()
            fields = (_POSITION, _AMPLITUDE, _FREQUENCY)
            effect["keyframes"] = [
                bits.keyframe([field for n, field in enumerate(fields) if mask >> n & 1])
                for mask in (bits.read(3) for _ in range(self._granted(bits)))
            ]
            if bits.read(16):
                raise TextureError(f"{bits.where}: a composite effect; Basis is rendered")
            self._count_effect(bits)
            perception["effect_library"].append(effect)

    def _take_data(self, bits: "_Bits") -> None:
        bits.read(1)
        of, channel_of, number = bits.read(8), bits.read(16), bits.read(8)
        key = (of, channel_of, number)
        band = _announced(self._bands, key, f"{bits.where}: band {number}")
        if self.perceptions[of]["perception_modality"] in _OVER_DISTANCE:
            return
        for _ in range(bits.read(16)):
            name, kind = bits.read(16), bits.named(_EFFECTS, 2, "effect type")
            made: Tree = {"effect_type": kind, "id": name}
            if band["band_type"] == "WaveletWave":
                bits.skip_semantic()
                made["wavelet_stream"] = stream_of(bits.octets(bits.read(16)))
                # Blocks follow one another from 0 on, as the reference decoder plays them.
                made["position"] = len(band["effects"]) * band["block_length"]
            else:
                made["position"] = self.time + bits.signed(25)
                if kind == "Basis":
                    self._take_basis(bits, band["band_type"], made)
                    begun = self._effects.setdefault((*key, name), made)
                    if begun is not made:
                        begun["keyframes"] += made["keyframes"]
                        continue
            self._count_effect(bits)
            band["effects"].append(made)

    def _take_basis(self, bits: "_Bits", kind: str, made: Tree) -> None:
        bits.skip_semantic()
        count = self._granted(bits)
        if kind == "VectorialWave":
            made |= bits.shape()
        frames = []
        for _ in range(count):
            mask = bits.read(2) if kind == "VectorialWave" else 3
            held = (mask & 1, 1, mask & 2 and kind != "Curve")
            fields = (_AMPLITUDE, _POSITION, _FREQUENCY)
            frames.append(
                bits.keyframe([f for f, is_held in zip(fields, held, strict=True) if is_held])
            )
        made["keyframes"] = frames

    def _granted(self, bits: "_Bits") -> int:
        """Return a number of keyframes that is read and may be."""
        count = bits.read(16)
        self._keyframes_left -= count
        if self._keyframes_left < 0:
            raise TextureError(f"{bits.where}: more than {MAX_KEYFRAMES} keyframes up to here")
        return count

    def _count_effect(self, bits: "_Bits") -> None:
        self._effects_left -= 1
        if self._effects_left < 0:
            raise TextureError(f"{bits.where}: more than {MAX_EFFECTS} effects up to here")


class _Bits:
    """Reads numbers from a header or payload.

    Parameters
    ----------
    data : bytes
        All of it.
    where : str
        Its place in the file.
    """

    def __init__(self, data: bytes, where: str) -> None:
        self.where = where
        self._data, self._at = data, 0

    def read(self, count: int) -> int:
        """Return the next bits as a number, 0 or above."""
        begin, self._at = self._at, self._at + count
        if self._at > 8 * len(self._data):
            raise TextureError(f"{self.where} ends within what it holds")
        octets = self._data[begin // 8 : -(-self._at // 8)]
        return int.from_bytes(octets) >> (-self._at % 8) & ((1 << count) - 1)

    def signed(self, count: int) -> int:
        """Return the next bits as a number in two's complement."""
        value = self.read(count)
        return value - (value >> (count - 1) << count)

    def share(self, count: int, low: float, high: float) -> float:
        """Return the next bits as a number from `low` to `high`."""
        return low + (high - low) * self.read(count) / ((1 << count) - 1)

    def named(self, names: Sequence[str], count: int, what: str) -> str:
        """Return what the next bits stand for."""
        code = self.read(count)
        if code >= len(names):
            raise TextureError(
                f"{self.where}: {what} {code}; 0 to {len(names) - 1} are read: the file is "
                "damaged, or no MPEG haptics stream (.hmpg)"
            )
        return names[code]

    def octets(self, count: int) -> bytes:
        """Return the next bytes."""
        return self.read(8 * count).to_bytes(count)

    def skip_text(self) -> None:
        """Pass over a text that begins with its length."""
        self.read(8 * self.read(8))

    def skip_semantic(self) -> None:
        """Pass over what an effect means, if it says so."""
        if self.read(1):
            self.read(12)

    def shape(self) -> Tree:
        """Return the phase and base signal of a wave."""
        phase = self.share(16, 0.0, _TURN)
        return {"phase": phase, "base_signal": self.named(_SIGNALS, 4, "base signal")}

    def keyframe(self, fields: Sequence[str]) -> Tree:
        """Return a keyframe that holds these fields."""
        return {
            field: self.share(8, -1.0, 1.0) if field == _AMPLITUDE else self.read(16)
            for field in fields
        }


def _announced(found: dict[Any, Tree], key: object, what: str) -> Tree:
    """Return metadata that came before."""
    if key not in found:
        raise TextureError(f"{what} was not announced before it")
    return found[key]
