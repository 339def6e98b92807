"""`frictus replay`: a recording plays as one more rig on a real router."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.service.recording.known import info
from tests.service.recording.test_export import RATE_HZ, STATUS, UTC_NS, Tape, value
from typer.testing import CliRunner

import frictus
from frictus.block import Block
from frictus.session import open_router
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.processes import free_endpoint
from frictus_service.recording.writer import RecordingWriter

SECONDS = 3.0
COMMAND = (sys.executable, "-c", "from frictus_service.cli import main; main()", "replay")


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "pilot.mcap"
    status = STATUS.model_copy(update={"touch_latency_s": 0.03})
    attached = {"status.json": status.to_json()}
    with RecordingWriter(path, info("pilot"), attached, lambda: 0.0) as writer:
        Tape(writer).play(SECONDS)
        writer.end("asked for", UTC_NS)
    return path


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
@pytest.mark.usefixtures("interruptible")
def test_what_was_sensed_is_sensed_again_by_whoever_reads_the_rig(recording: Path) -> None:
    endpoint = free_endpoint()
    with open_router(endpoint), frictus.connect(endpoint) as client:
        command = [*COMMAND, str(recording), "--router", endpoint, "--rig", "again"]
        process = subprocess.Popen(
            command, cwd=recording.parent, stderr=subprocess.PIPE, text=True
        )
        try:
            rig = client.rig("again", "lab", wait_s=120.0)
            assert rig.status().simulated
            with rig.blocks("force", timeout_s=20.0) as blocks:
                block = next(block for block in blocks if isinstance(block, Block))
        finally:
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=60)
    assert process.returncode in (0, Exit.INTERRUPTED), said
    assert f"pilot.mcap: {SECONDS:.2f} s, 0 samples missing" in said
    first = block.first_sample % int(SECONDS * RATE_HZ)
    expected = value(1, first, block.data.shape[1])
    np.testing.assert_allclose(block.data, expected, atol=1e-6)


@pytest.mark.long
def test_once_ends_with_the_recording(recording: Path) -> None:
    endpoint = free_endpoint()
    with open_router(endpoint):
        done = subprocess.run(
            [*COMMAND, str(recording), "--router", endpoint, "--once"],
            cwd=recording.parent,
            capture_output=True,
            text=True,
            timeout=110.0,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    assert f"tripped, device_lost: the recording 'pilot' is over, after {SECONDS:.2f} s" in (
        done.stderr
    )


@pytest.mark.parametrize(
    ("name", "more", "told"),
    [
        ("none.mcap", (), "there is no file"),
        ("noise.npz", (), "not a whole file of replay/1"),
        ("pilot.mcap", ("--rig", "a/b"), "rig: "),
    ],
)
def test_what_cannot_be_played_is_told_in_a_sentence(
    name: str, more: tuple[str, ...], told: str, recording: Path
) -> None:
    (recording.parent / "noise.npz").write_bytes(b"mice")
    result = CliRunner().invoke(app, ["replay", str(recording.with_name(name)), *more])
    assert result.exit_code == Exit.USAGE
    assert told in " ".join(result.stderr.replace("│", " ").split())
