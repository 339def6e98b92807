"""The binary frame: what is packed is read again, and nothing else is."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frictus.block import Flag
from frictus.errors import FrameError
from frictus.websocket.frames import HEADER_BYTES, Frame, Kind

U32, U64 = st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    kind = draw(st.sampled_from(Kind))
    channels, columns = draw(st.integers(1, 5)), draw(st.integers(0, 30))
    shape = (channels, 2, columns) if kind == Kind.EXTREMES else (channels, columns)
    data = np.random.default_rng(draw(U32)).normal(size=shape).astype(np.float32)
    return Frame(
        stream=draw(st.integers(1, 5)),
        flags=draw(st.integers(0, 2**16 - 1)),
        run=draw(U32),
        first_sample=draw(U64),
        lost_samples=draw(U64),
        sample_rate_hz=draw(st.floats(1.0, 1e6)),
        samples_per_column=draw(st.integers(1, 2**32 - 1)),
        kind=kind,
        utc_ns=draw(U64),
        data=data,
    )


@settings(deadline=None)  # the machine may be busy
@given(frames())
def test_round_trip(frame: Frame) -> None:
    packed = frame.pack()
    assert len(packed) == HEADER_BYTES + frame.data.nbytes
    read = Frame.unpack(packed)
    assert read.data.shape == frame.data.shape
    assert read.data.tobytes() == frame.data.tobytes()
    assert read.pack() == packed
    assert read.next_sample == frame.next_sample


@settings(deadline=None)  # the machine may be busy
@given(frames(), st.data())
def test_any_other_length_is_refused(frame: Frame, data: st.DataObject) -> None:
    packed = frame.pack()
    cut = data.draw(st.integers(0, len(packed) - 1))
    with pytest.raises(FrameError):
        Frame.unpack(packed[:cut])
    with pytest.raises(FrameError):
        Frame.unpack(packed + b"\0")


@settings(deadline=None)  # the machine may be busy
@given(st.binary(max_size=200))
def test_noise_is_refused_or_read(noise: bytes) -> None:
    try:
        assert Frame.unpack(noise).pack()[:8] == noise[:8]
    except FrameError:
        pass


@pytest.mark.parametrize(("at", "what"), [(0, "version"), (44, "kind"), (4, "channels")])
def test_wrong_fields_are_named(at: int, what: str) -> None:
    frame = Frame(1, 0, 1, 0, 0, 1e3, 1, Kind.RAW, 0, np.zeros((2, 3), np.float32))
    packed = bytearray(frame.pack())
    packed[at : at + 2] = b"\xff\xff" if what != "channels" else b"\0\0"
    with pytest.raises(FrameError, match=what):
        Frame.unpack(bytes(packed))


def test_what_does_not_fit_is_refused() -> None:
    frame = Frame(1, 0, -1, 0, 0, 1e3, 1, Kind.RAW, 0, np.zeros((2, 3), np.float32))
    with pytest.raises(FrameError, match="header"):
        frame.pack()


def test_the_frame_in_the_docs() -> None:
    docs = (Path(__file__).parents[3] / "docs" / "websocket.md").read_text(encoding="utf-8")
    worked = next(part for part in docs.split("```") if part.startswith("\n01 00"))
    frame = Frame.unpack(bytes.fromhex(worked))
    assert (frame.stream, frame.run, frame.first_sample, frame.next_sample) == (1, 7, 400, 480)
    assert frame.flags == Flag.ARMED | Flag.SIMULATED
    assert frame.utc_ns == 1_767_225_600 * 10**9
    assert frame.data.tolist() == [[[-0.5, 0.0], [0.25, 1.0]]]
