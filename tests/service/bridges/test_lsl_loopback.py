"""From a running rig to an XDF file, as LabRecorder would write it and an analyst reads it."""

import json
import os
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pylsl
import pytest
import pyxdf
from numpy.typing import NDArray

import frictus
from frictus_service.config import Config

SAMPLES = 80_000
"""4 s."""
BRIDGE = "from frictus_service.cli import main; main()"
TEXTURE = frictus.Spectrum(components=[frictus.Component(amplitude_n=0.05, cycles_per_mm=1.0)])
STREAMS = ("force", "accel", "finger", "markers")


@pytest.fixture
def bridge(config: Config, lsl: Path) -> Iterator["subprocess.Popen[str]"]:
    command = [sys.executable, "-c", BRIDGE, "lsl", "--json"]
    command += ["--rig", config.rig, "--router", config.router.endpoint, "--seconds", "60"]
    environment = os.environ | {"LSLAPICFG": str(lsl)}
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process
        process.kill()


class Gathered:
    """What came on a stream."""

    def __init__(self, inlet: Any) -> None:
        self.inlet = inlet
        self._rows: list[NDArray[Any]] = []
        self._stamps: list[NDArray[np.float64]] = []
        self.n = 0

    def pull(self) -> None:
        rows, stamps = self.inlet.pull_chunk(timeout=0.0, max_samples=20_000)
        if len(stamps):
            self._rows.append(rows)
            self._stamps.append(np.array(stamps))
            self.n += len(stamps)

    @property
    def rows(self) -> NDArray[Any]:
        return np.concatenate(self._rows)

    @property
    def stamps(self) -> NDArray[np.float64]:
        return np.concatenate(self._stamps)


def test_nothing_is_lost_and_time_rises_and_is_right(
    config: Config, bridge: "subprocess.Popen[str]", inlet: Any, tmp_path: Path
) -> None:
    with frictus.connect(config.router.endpoint, patient=True) as client:
        rig = client.rig(config.rig)
        before = rig.status().counters
        with (
            rig.blocks("force", capacity=8_192) as force,
            rig.blocks("accel", capacity=8_192) as accel,
        ):
            next(force)  # both subscribe before LSL does
            next(accel)
            came = {name: Gathered(inlet(f"{config.rig}-{name}")) for name in STREAMS}
            etag = _set_scene(rig)
            blocks: dict[str, list[Any]] = {"force": [], "accel": []}
            while min(came[name].n for name in blocks) < SAMPLES:
                for one in came.values():
                    one.pull()
                blocks["force"] += force.drain()
                blocks["accel"] += accel.drain()
                time.sleep(0.02)
            # What came on LSL must be known from the blocks: these may come later.
            pulled_ns = time.time_ns()
            for name, feed in (("force", force), ("accel", accel)):
                while not _newest_ns(blocks[name]) > pulled_ns:
                    blocks[name] += [next(feed), *feed.drain()]
        after = rig.status().counters
    ahead_s = 1e-9 * time.time_ns() - pylsl.local_clock()
    rate_hz = {name: _hold(came[name], sent, ahead_s) for name, sent in blocks.items()}
    finger = came["finger"].stamps
    assert np.all(np.diff(finger) > 0.0)
    assert not np.isnan(came["finger"].rows).any()
    assert any(text[0].decode().startswith(f"scene {etag}") for text in came["markers"].rows)
    assert after.blocks_dropped == before.blocks_dropped
    assert bridge.stdout is not None
    told = [json.loads(line) for line in (bridge.stdout.readline(), bridge.stdout.readline())]
    assert told[-1]["filled"] == {"force": 0, "accel": 0, "finger": 0}
    assert 0.0 < told[-1]["cpu_percent"] < 100.0
    path = tmp_path / "pilot.xdf"
    write_xdf(path, list(came.values()))
    _read_back(path, came, rate_hz)


def _newest_ns(items: list[Any]) -> int:
    """Return when the newest block begins."""
    return max((item.utc_ns for item in items if isinstance(item, frictus.Block)), default=0)


def _set_scene(rig: frictus.Rig) -> str:
    rig.set_scene(TEXTURE)
    return rig.scene().etag


def _hold(came: Gathered, items: list[Any], ahead_s: float) -> float:
    """Hold what came on LSL against the blocks themselves; return the rate these tell, Hz.

    The rig's fit of its own clock moves while that is young, the more the busier the machine:
    what LSL tells is held to the rate that the rig told, and that one to what a fit may be off
    by (200 ppm, approached at no more than 500).
    """
    blocks = [item for item in items if isinstance(item, frictus.Block)]
    assert len(blocks) == len(items), "this reader lost none, so that it may judge"
    all_rows = np.concatenate([block.data.T for block in blocks])
    rows, stamps = came.rows, came.stamps
    starts = np.flatnonzero((all_rows[: -len(rows) or None] == rows[0]).all(axis=1))
    (start,) = [at for at in starts if np.array_equal(all_rows[at : at + len(rows)], rows)]
    assert np.all(np.diff(stamps) > 0.0)
    edges = np.cumsum([0] + [block.data.shape[1] for block in blocks])
    at, sent_s = np.array(
        [
            (edge - start, 1e-9 * block.utc_ns - ahead_s)
            for block, edge in zip(blocks, edges.tolist(), strict=False)
            if 0 <= edge - start < len(stamps)
        ]
    ).T
    assert np.max(np.abs(stamps[at.astype(np.int64)] - sent_s)) < 1e-3
    rate_hz = float(1.0 / np.polyfit(at, sent_s - sent_s[0], 1)[0])
    assert rate_hz == pytest.approx(20_000.0, rel=7e-4)
    return rate_hz


def write_xdf(path: Path, streams: list[Gathered]) -> None:
    """Write streams as LabRecorder does: headers, samples with stamps, clock offsets, footers.

    https://github.com/sccn/xdf/wiki/Specifications
    """
    with path.open("wb") as file:

        def chunk(tag: int, content: bytes) -> None:
            file.write(struct.pack("<BQH", 8, len(content) + 2, tag) + content)

        file.write(b"XDF:")
        chunk(1, b'<?xml version="1.0"?><info><version>1.0</version></info>')
        for number, one in enumerate(streams, 1):
            stream = struct.pack("<I", number)
            info = one.inlet.info(20.0)
            chunk(2, stream + info.as_xml().encode())
            offset_s = one.inlet.time_correction(20.0)
            for at_s in (one.stamps[0], one.stamps[-1]):
                chunk(4, stream + struct.pack("<dd", at_s, offset_s))
            content = b"".join(
                struct.pack("<Bd", 8, stamp) + _values(row)
                for row, stamp in zip(one.rows, one.stamps, strict=True)
            )
            chunk(3, stream + struct.pack("<BI", 4, one.n) + content)
            ends = (
                f"<first_timestamp>{one.stamps[0]!r}</first_timestamp>"
                f"<last_timestamp>{one.stamps[-1]!r}</last_timestamp>"
                f"<sample_count>{one.n}</sample_count>"
            )
            chunk(6, stream + f'<?xml version="1.0"?><info>{ends}</info>'.encode())


def _values(row: NDArray[Any]) -> bytes:
    if row.dtype == object:
        return b"".join(struct.pack("<BI", 4, len(text)) + text for text in row)
    return row.tobytes()


def _read_back(path: Path, came: dict[str, Gathered], rate_hz: dict[str, float]) -> None:
    streams, _ = pyxdf.load_xdf(str(path))
    found = {one["info"]["name"][0].rpartition("-")[2]: one for one in streams}
    assert found.keys() == came.keys()
    for name in ("force", "accel"):
        one = found[name]
        assert np.array_equal(one["time_series"], came[name].rows)
        # Straightened by counting: one piece, and no further from what was sent than 1 ms.
        assert len(one["info"]["segments"]) == 1
        assert np.max(np.abs(one["time_stamps"] - came[name].stamps)) < 1e-3
        assert one["info"]["effective_srate"] == pytest.approx(rate_hz[name], rel=2e-4)
        channels = one["info"]["desc"][0]["channels"][0]["channel"]
        assert [channel["label"][0] for channel in channels] == ["x", "y", "z"]
    assert found["markers"]["time_series"]
