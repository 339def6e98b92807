"""Writes HJIF documents in their binary form, so that tests know what a reader must return."""

from typing import Any

import numpy as np
from tests.clients.effect_files.wavelet_coder import DIGITS

MODALITIES = {"Vibrotactile": 6, "Stiffness": 11, "Temperature": 5}
BANDS = ("Transient", "Curve", "VectorialWave", "WaveletWave")
CURVES = ("Unknown", "Cubic", "Linear", "Akima")
SIGNALS = ("Sine", "Square", "Triangle", "SawToothUp", "SawToothDown")
INITIALIZATION, TEMPORAL, SILENT = 0, 1, 3
PERCEPTION, CHANNEL, BAND, DATA, LIBRARY, BEGIN = 2, 3, 4, 5, 6, 11
Tree = dict[str, Any]
Fields = list[tuple[int, int]]
"""Values and how many bits each has."""


def octets(fields: Fields) -> bytes:
    """Return fields as bytes, zeros at their end."""
    text = "".join(format(value & (1 << bits) - 1, f"0{bits}b") for value, bits in fields)
    text += "0" * (-len(text) % 8)
    return int(text or "0", 2).to_bytes(len(text) // 8)


def packet(kind: int, fields: Fields) -> bytes:
    """Return a packet."""
    payload = octets(fields)
    return octets([(kind, 6), (len(payload), 17), (0, 1)]) + payload


def unit(kind: int, ticks: int, *packets: bytes) -> bytes:
    """Return a unit that lasts some ticks."""
    length = sum(map(len, packets))
    head = octets([(kind, 6), (0, 2), (0, 4), (ticks, 24), (length, 32), (0, 4)])
    return head + b"".join(packets)


def hmpg(document: Tree, unit_ticks: int = 10**6) -> bytes:
    """Return a document in its binary form.

    Parameters
    ----------
    document : dict
        HJIF of one perception.
    unit_ticks : int
        Effects and keyframes are cut into units that last so long; blocks stand one in a unit.
    """
    begin = packet(BEGIN, [(0, 32), (document["timescale"], 32), (128, 24), (0, 24), (0, 1)])
    perception = document["perceptions"][0]
    packets, datas, number = [begin, *_metadata(perception)], list[tuple[int, bytes]](), 0
    for at, channel in enumerate(perception["channels"]):
        packets.append(packet(CHANNEL, _channel(at, channel)))
        for band in channel["bands"]:
            packets.append(packet(BAND, _band(number, at, band)))
            datas += _datas(number, at, band, unit_ticks)
            number += 1
    units, time = [unit(INITIALIZATION, 0, *packets)], 0
    for ticks in sorted({ticks for ticks, _ in datas}):
        if ticks > time:
            units.append(unit(SILENT, ticks - time))
        units.append(unit(TEMPORAL, 1, *(data for at, data in datas if at == ticks)))
        time = ticks + 1
    return b"".join(units)


def _metadata(perception: Tree) -> list[bytes]:
    modality = MODALITIES[perception["perception_modality"]]
    effects = perception["effect_library"]
    exponent = perception.get("perception_unit_exponent", 0)
    text: Fields = [(1, 8), (65, 8)]
    about: Fields = [(3, 8), (0, 8), *text, (modality, 8), (0, 8), (len(effects), 16), (1, 1)]
    packets = [packet(PERCEPTION, [*about, *text, (-3, 8), (exponent, 8), (0, 8), (1, 16)])]
    if effects:
        library: Fields = [(3, 8), (len(effects), 16)]
        for effect in effects:
            library += [(effect["id"], 16), (0, 2), (1, 1), (0, 12), (0, 25), *_shape(effect)]
            library.append((len(effect["keyframes"]), 16))
            for frame in effect["keyframes"]:
                held = [name in frame for name in ("relative_position", *_MODULATIONS)]
                library.append((sum(is_held << n for n, is_held in enumerate(held)), 3))
                library += _position(frame) + _amplitude(frame) + _frequency(frame)
            library.append((0, 16))
        packets.append(packet(LIBRARY, library))
    return packets


def _channel(number: int, channel: Tree) -> Fields:
    gain = round((channel["gain"] + 10_000.0) / 20_000.0 * (2**32 - 1))
    mixed = round(channel["mixing_coefficient"] / 10_000.0 * (2**32 - 1))
    text: Fields = [(0, 8), (0, 8), (255, 8)]
    return [(number, 16), (3, 8), *text, (gain, 32), (mixed, 32), (1, 8), (0, 32), (0, 32)]


def _band(number: int, channel: int, band: Tree) -> Fields:
    kind = band["band_type"]
    fields: Fields = [(number, 8), (3, 8), (channel, 16), (0, 8), (BANDS.index(kind), 3)]
    if kind == "Curve":
        fields.append((CURVES.index(band.get("curve_type", "Unknown")), 4))
    if kind == "WaveletWave":
        fields.append((band["block_length"], 8))
    return [*fields, (0, 16), (band["upper_frequency_limit"], 16), (len(band["effects"]), 16)]


def _datas(number: int, channel: int, band: Tree, unit_ticks: int) -> list[tuple[int, bytes]]:
    """Return data packets and the ticks at which their units begin."""
    kind, found = band["band_type"], dict[int, list[Fields]]()
    for name, effect in enumerate(band["effects"], 1_000):
        if kind == "WaveletWave":
            stream = _bytes_of(effect["wavelet_stream"])
            block: Fields = [(name, 16), (0, 2), (0, 1), (len(stream), 16)]
            block += [(byte, 8) for byte in stream]
            found.setdefault(effect["position"], []).append(block)
        elif effect["effect_type"] == "Reference":
            begin = effect["position"] // unit_ticks * unit_ticks
            head: Fields = [(effect["id"], 16), (1, 2), (effect["position"] - begin, 25)]
            found.setdefault(begin, []).append(head)
        else:
            parts: dict[int, list[Tree]] = {}
            for frame in effect["keyframes"]:
                ticks = effect["position"] + frame["relative_position"]
                parts.setdefault(ticks // unit_ticks * unit_ticks, []).append(frame)
            for begin, frames in parts.items():
                head = [(name, 16), (0, 2), (effect["position"] - begin, 25), (0, 1)]
                head.append((len(frames), 16))
                head += _shape(effect) if kind == "VectorialWave" else []
                held = [field for frame in frames for field in _keyframe(frame, kind)]
                found.setdefault(begin, []).append(head + held)
    before: Fields = [(0, 1), (3, 8), (channel, 16), (number, 8)]
    return [
        (at, packet(DATA, [*before, (len(effects), 16), *(f for e in effects for f in e)]))
        for at, effects in found.items()
    ]


def _keyframe(frame: Tree, kind: str) -> Fields:
    if kind == "VectorialWave":
        held = [name in frame for name in _MODULATIONS]
        mask: Fields = [(held[0] | held[1] << 1, 2)]
        return mask + _amplitude(frame) + _position(frame) + _frequency(frame)
    always = {"amplitude_modulation": 0.0, "frequency_modulation": 0} | frame
    return _amplitude(always) + _position(frame) + _frequency(always) * (kind == "Transient")


_MODULATIONS = ("amplitude_modulation", "frequency_modulation")


def _position(frame: Tree) -> Fields:
    return [(frame["relative_position"], 16)]


def _amplitude(frame: Tree) -> Fields:
    value = frame.get("amplitude_modulation")
    return [] if value is None else [(round((value + 1.0) / 2.0 * 255.0), 8)]


def _frequency(frame: Tree) -> Fields:
    return [(frame[name], 16) for name in ("frequency_modulation",) if name in frame]


def _shape(effect: Tree) -> Fields:
    phase = round(effect.get("phase", 0.0) / 6.28318 * 65_535)
    return [(phase, 16), (SIGNALS.index(effect.get("base_signal", "Sine")), 4)]


def _bytes_of(stream: str) -> bytes:
    bits = [DIGITS.index(digit) >> n & 1 for digit in stream for n in range(5, -1, -1)]
    return np.packbits(np.array(bits, dtype=np.uint8), bitorder="little").tobytes()
