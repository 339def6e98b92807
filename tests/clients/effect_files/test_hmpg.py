"""The binary form of MPEG haptics: it renders as the document it stands for."""

import base64
import contextlib
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.clients.effect_files.hmpg_writer import hmpg, octets, packet, unit
from tests.clients.effect_files.made import band, basis, hjif, keyframes
from tests.clients.effect_files.wavelet_coder import stream

from frictus.effect_files import hmpg as reader
from frictus.effect_files import render_effect
from frictus.errors import TextureError

TONE = basis(
    0, keyframes((0, 0.5, 200), (60, 0.25, None)), base_signal="Triangle", phase=1.0, id=7
)
AGAIN = {"effect_type": "Reference", "id": 7, "position": 150}
BURSTS = band("Transient", basis(20, keyframes((0, 0.8, 90), (150, -0.6, 90))))
COURSE = band(
    "Curve",
    basis(0, keyframes((0, 0.0, None), (100, 0.4, None), (250, 0.0, None))),
    curve_type="Akima",
)
WAVE = band(
    "VectorialWave",
    basis(0, keyframes((0, 0.2, 100), (250, 0.1, 300)), base_signal="Square"),
    AGAIN,
)


def blocks(signal: np.ndarray) -> dict[str, Any]:
    """Return a wavelet band at 8 kHz of blocks of 128 ms."""
    effects = [
        {
            "effect_type": "Basis",
            "position": n // 8,
            "wavelet_stream": stream(signal[n : n + 1_024], 9),
        }
        for n in range(0, signal.size, 1_024)
    ]
    made = band("WaveletWave", *effects, block_length=128)
    return made | {"upper_frequency_limit": 8_000}


def document(*bands: dict[str, Any], gain: float = 0.5, **more: Any) -> dict[str, Any]:
    """Return an HJIF document whose library holds `TONE`."""
    made: dict[str, Any] = json.loads(hjif(*bands, library=[TONE], **more))
    made["perceptions"][0]["channels"][0]["gain"] = gain
    return made


ALL = document(BURSTS, COURSE, WAVE, blocks(0.3 * np.sin(np.arange(2_048) / 6.0)))


@pytest.mark.parametrize("unit_ticks", [10**6, 128, 50, 7])
def test_it_renders_as_its_document(unit_ticks: int) -> None:
    wanted = render_effect(json.dumps(ALL), ".hjif")
    found = render_effect(hmpg(ALL, unit_ticks), ".hmpg")
    # Amplitudes have 8 bits: each of five bands is off by up to a 510th, times the gain.
    np.testing.assert_allclose(found.signal, wanted.signal, atol=0.5 * 5 / 510 + 0.001)
    assert np.max(np.abs(found.signal)) > 0.3


def test_what_the_reference_encoder_wrote_renders_too() -> None:
    # MPEG's reference encoder made it of `ALL` with a tone of 210 Hz in coarser blocks.
    tone = 0.3 * np.sin(2.0 * np.pi * 210.0 * np.arange(2_048) / 8_000)
    wanted = render_effect(json.dumps(document(BURSTS, COURSE, WAVE, blocks(tone))), ".hjif")
    found = render_effect(base64.b64decode(REFERENCE), ".hmpg")
    assert found.duration_s == pytest.approx(0.256)
    deviation = np.sqrt(np.mean((found.signal - wanted.signal) ** 2))
    assert deviation < 0.02 * np.sqrt(np.mean(wanted.signal**2))


def test_units_exponents_gains_and_silence_count() -> None:
    made = document(BURSTS, gain=-5.0, perception_unit_exponent=-1)
    at_once = hmpg(made)
    later = at_once[: -_last_unit(at_once)] + unit(3, 300) + at_once[-_last_unit(at_once) :]
    first, second = (render_effect(data, ".hmpg") for data in (at_once, later))
    assert np.min(first.signal) == pytest.approx(-0.5 * 0.8, rel=0.02)
    assert second.duration_s == pytest.approx(first.duration_s + 0.3)
    np.testing.assert_allclose(second.signal[1_800:], first.signal, atol=0.01)


def _last_unit(data: bytes) -> int:
    """Return how many bytes the last unit of a file of two has."""
    return len(data) - 9 - int.from_bytes(data[4:9]) // 16 % 2**32


def test_metadata_may_be_repeated_and_check_sums_are_passed_over() -> None:
    data = hmpg(ALL)
    cut = len(data) - _last_unit(data)
    check = unit(1, 0, packet(8, [(0xBEEF, 16)]), packet(1, [(0, 8)]), packet(0, [(0, 32)]))
    # The library would be told twice, which a document may not; its first effect counts.
    again = data[:cut] + check + data[:cut] + data[cut:]
    np.testing.assert_array_equal(
        render_effect(again, ".hmpg").signal, render_effect(data, ".hmpg").signal
    )


def test_perceptions_over_distance_are_left_out_with_a_word() -> None:
    data = hmpg(document(BURSTS, perception_modality="Stiffness"))
    with pytest.raises(TextureError, match="Stiffness is left out: it is over distance"):
        render_effect(data, ".hmpg")


def tampered(kind: int, *fields: tuple[int, int]) -> bytes:
    """Return a file whose second unit holds one packet of our own."""
    data = hmpg(ALL)
    return data[: len(data) - _last_unit(data)] + unit(1, 0, packet(kind, list(fields)))


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"", "no band to render"),
        (b"{}", "unit type 30; 0 to 3 are read: the file is damaged, or no MPEG haptics"),
        (b"\x00\x01", "the unit at byte 0 ends within"),
        (octets([(0, 36), (500, 32), (0, 4)]), "has 500 bytes, of which 0 are there"),
        (hmpg(ALL)[:-1], "the file is cut"),
        (unit(1, 0, octets([(5, 6), (90, 17), (0, 1)])), "longer than its unit"),
        (unit(1, 0, b"\x14"), "the packet at byte 9 ends within"),
        (tampered(12), "is of type 12; 0 to 11 are read"),
        (tampered(2, (3, 8), (0, 8), (0, 8), (14, 8)), "modality 14; 0 to 13 are read"),
        (tampered(2, (3, 8), (0, 8), (200, 8), (14, 8)), "ends within what it holds"),
        (tampered(3, (0, 16), (9, 8), (0, 100)), "perception 9 was not announced before it"),
        (tampered(4, (0, 8), (3, 8), (9, 16), (0, 100)), "channel 9 was not announced"),
        (tampered(4, (0, 8), (3, 8), (0, 16), (0, 8), (5, 3)), "band type 5; 0 to 3 are read"),
        (tampered(4, (0, 8), (3, 8), (0, 16), (0, 8), (1, 3), (9, 4)), "curve type 9; 0 to 5"),
        (tampered(5, (0, 1), (3, 8), (0, 16), (9, 8)), "band 9 was not announced before it"),
        (tampered(5, (0, 1), (3, 8), (0, 16), (0, 8), (1, 16), (1, 16), (3, 2)),
         "effect type 3; 0 to 2 are read"),
        (tampered(6, (3, 8), (1, 16), (1, 16), (2, 2), (0, 1), (0, 25), (0, 16), (1, 16)),
         "a composite effect"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused(data: bytes, complaint: str) -> None:
    with pytest.raises(TextureError, match=complaint):
        render_effect(data, ".hmpg")


def test_a_file_cannot_ask_for_more_than_is_granted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "MAX_PACKETS", 20)
    with pytest.raises(TextureError, match="more than 20 packets and units"):
        render_effect(hmpg(ALL) + unit(3, 0) * 21, ".hmpg")
    many = tampered(6, (3, 8), (65_535, 16), *[(0, 16), (1, 2), (0, 26), (0, 32)] * 12)
    monkeypatch.setattr(reader, "MAX_EFFECTS", 10)
    with pytest.raises(TextureError, match="more than 10 effects up to here"):
        render_effect(many, ".hmpg")
    monkeypatch.setattr(reader, "MAX_KEYFRAMES", 3)
    with pytest.raises(TextureError, match="more than 3 keyframes up to here"):
        render_effect(hmpg(ALL), ".hmpg")


@settings(deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 7), st.booleans())
def test_no_damage_ends_otherwise_than_in_words(place: int, bit: int, is_cut: bool) -> None:
    data = bytearray(hmpg(document(BURSTS, COURSE, WAVE)))
    place %= len(data)
    data[place] ^= 1 << bit
    with contextlib.suppress(TextureError):
        effect = render_effect(bytes(data[:place] if is_cut else data), ".hmpg")
        assert np.all(np.isfinite(effect.signal))


REFERENCE = (
    "AAAAAAAAAAyALAAeAAAAAAAAA+gAAIAAAAAABABEBDIwMjMETWFpbgEKMjAyNi0wMS0wMQltYWRlIGhlcmUBAAgA"
    "LAAACWFsbCBraW5kcwYAAAF+gAAAAIAYADAAAAEABwAAAAKL4gAC4AAX4BkMAPJ8AAAMADoAAAAAA29uZf+AAaL/"
    "AAaNuAEAAAAAAAAAAAAABBAAGAAAAAAAAAAAfQAAIBAAGAEAAAAAJgAAB9AAAhAAGAIAAAAAQAAAfQAAQBAAGgMA"
    "AAAAcAAAA+gAAEAEAAAIAAAAD3AUACYAAAAAAACABAAAAUAADygAAALQFAAoAAAAAIAAgASAAAAAABP4AAWQAyAU"
    "ACwAAAABAACABQAAAAAACAAA8yAAAAyAFAFcAAAAAYAAgAWACjtswAZEo0XJAs+aTcPaDJDaQAgHDqexTZq/Rj3E"
    "XsDO+xIzHAijfj65GwgwFzNGuULupT4IJ5girXvtbLB0wllIoNzrql5URiXikb3vgcQF9BwSXrflS6klJJKQ5Ce/"
    "dagJL9Sc3vFEFi+fAC7P//////j1jj96jf0D2fXQkirdR6MRK3sKwtI9UfyxTIfBVyyJ0JAACwsCImx5D2IZBCGp"
    "8OZgBQAACAAAAA9QFAAmgAAAAAAAgAQf//lAAAmQBLAC0BQAIoAAAACAAIAEn//4AAAL+AfQFAA2AAAAAQABAAUf"
    "//gAAAgAAPGAH0AlgADoAABYFAFUAAAAAYAAgAYACftswAZEo0XDDY8aDrFy5VNKcCgFcMMvxDM09m6t8mII+jSE"
    "kCHWcdcEtG2orvZ2oUKS+QOon+SphxkMwRAE1sPr6A/jrTKosMPYhicMC5+WD9AqHz3j8eEoCdecLdAlAv3usuD0"
    "EYLRdY/f/////P+ItjGbHKKXgRDu+qSZySvRiIg4Ai/v9ypiZc05Hl/xcAAMB6rMSQzDqUu3D//64BA="
)
