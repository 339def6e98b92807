"""The tracker over a recording in which a rig is told of one person, and then of another."""

import time
from pathlib import Path

import numpy as np
import pytest
from tests.rig_status import rig_status
from tests.service.tracking.played import RATE_HZ, played

from frictus.block import Block, Flag
from frictus.keys import FORCE, RENDER, VOLTAGE, Topics
from frictus.messages import ModelState, TouchState
from frictus.model import Validity
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.twin import Signals
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.records import RecordingInfo
from frictus_service.recording.writer import RecordingWriter
from frictus_service.tracking.recorded import follow_recording

BLOCK = 100
SECONDS = 8.0
SCAN = 320
"""Samples from one touch report to the next."""
KNOWN = np.diag([1e-4, 1e-4, 1e-4, 1e-12])
INFO = RecordingInfo(
    name="two", site="lab", rig="rig1", participant="P00", started_utc_ns=0, software="test"
)


def write(writer: RecordingWriter, felt: Signals, sequence: int) -> None:
    """Write what one person feels, from a block on."""
    rows = {
        FORCE: felt.force_n.T,
        VOLTAGE: felt.voltage_v[np.newaxis],
        RENDER: np.vstack([felt.position_mm.T, np.hypot(*felt.velocity_mm_s.T)]),
    }
    for first in range(0, felt.voltage_v.size, BLOCK):
        sample = sequence * BLOCK + first
        utc_ns = round(1e9 * sample / RATE_HZ)
        at = (1, sample // BLOCK, sample, utc_ns, 100, RATE_HZ, Flag.SIMULATED)
        for stream, data in rows.items():
            part = data[:, first : first + BLOCK].astype(np.float32)
            writer.block(Block(stream, *at, part))
        for scan in range(first - first % -SCAN, first + BLOCK, SCAN):
            x_mm, y_mm = felt.position_mm[scan].tolist()
            report = TouchState(
                run=1,
                sample=float(sequence * BLOCK + scan),
                x_mm=x_mm,
                y_mm=y_mm,
                in_contact=True,
                source="simulated",
            )
            writer.state(Topics.TOUCH, report.to_json(), utc_ns)


@pytest.mark.parametrize("named", [True, False])
def test_who_is_announced_is_not_mixed_with_who_was_before(
    named: bool, tmp_path: Path, seed: int
) -> None:
    people = {
        "P01": SimulatedParticipant(gain_n=0.39),
        "P02": SimulatedParticipant(gain_n=0.45, cutoff_0_hz=330.0, slope_hz_per_mm_s=12.0),
    }
    path = tmp_path / "two.mcap"
    validity = Validity(
        speed_mm_s=(20.0, 100.0), normal_force_n=(0.1, 1.0), drive_vpp=(150.0, 150.0)
    )
    sequence = 0
    with RecordingWriter(path, INFO, {}, time.monotonic) as writer:
        writer.state(Topics.STATUS, rig_status().to_json(), 0)
        for number, (name, person) in enumerate(people.items()):
            law = person.law
            at = coordinates.from_law(
                law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, skew_s=0.0
            )
            who = name if named else None
            model = coordinates.document(at, KNOWN, who, validity, {})
            told = ModelState(etag=name, model=model)
            writer.state(Topics.MODEL, told.to_json(), round(5e4 * sequence * BLOCK))
            felt = played(person, SECONDS, seed + number)
            write(writer, felt, sequence)
            sequence += felt.voltage_v.size // BLOCK
        writer.end("done", 0)
    counts: list[int] = []
    with RecordingReader(path) as reader:
        state = follow_recording(
            reader, Mount().lateral, Prior.weak(), lambda told: counts.append(told.windows)
        )
    assert state.participant == ("P02" if named else "P00")
    assert counts != sorted(counts)  # it began anew
    assert state.alarms == ()
    assert state.law is not None
    assert state.law.gain_n.value == pytest.approx(0.45, rel=0.02)
