"""What a type checker of a user's program sees of the client; `mypy` holds the types."""

import subprocess
import sys
from importlib.resources import files
from pathlib import Path
from typing import assert_type

import pytest

import frictus
from frictus.messages import (
    AdaptationPolicy,
    FingerState,
    RigStatus,
    SafetyState,
    SceneState,
    TouchState,
)


def look(client: frictus.Client) -> None:
    """Read what a rig says and streams; never called."""
    rig = client.rig("rig1")
    assert_type(rig, frictus.Rig)
    assert_type(rig.status(), RigStatus)
    assert_type([found.name for found in client.rigs()], list[str])
    with rig.fingers() as fingers:
        assert_type(fingers, frictus.Feed[FingerState])
        assert_type(next(fingers).x_mm, float)
    for touch in rig.touches():
        assert_type(touch, TouchState)
    for item in rig.blocks("force"):
        assert_type(item, frictus.Block | frictus.Gap)


async def look_on(rig: frictus.Rig) -> None:
    """Do the same in an event loop; never called."""
    async for finger in rig.fingers():
        assert_type(finger, FingerState)


def play(rig: frictus.Rig, texture: frictus.Texture) -> None:
    """Drive a rig; never called."""
    assert_type(rig.set_scene(texture), SceneState)
    with rig.arm() as lease:
        assert_type(lease, frictus.Lease)
        assert_type(rig.compensate("fixed", speed_mm_s=60.0), frictus.Compensation)
        assert_type(rig.set_adaptation("suggest"), AdaptationPolicy)
        with rig.open_stream(peak_n=0.1) as stream:
            assert_type(stream, frictus.TextureStream)
    assert_type(rig.stop(), SafetyState)


ROOT = Path(__file__).parents[2]
WRONG = """
import frictus

def play(rig: frictus.Rig) -> None:
    rig.blocks("forces")
    rig.arm(lease_ms="long")
    rig.status().states
"""


def test_the_package_tells_its_types() -> None:
    assert files(frictus).joinpath("py.typed").is_file()


@pytest.mark.timeout(300.0)  # where nothing is kept yet, all is read
def test_a_wrong_program_is_refused_before_it_runs(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(WRONG, encoding="utf-8")
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", str(program)],
        cwd=ROOT,  # with the project's settings, and what its own check has kept
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
    )
    lines = [line.split(":")[1] for line in checked.stdout.splitlines() if ": error:" in line]
    assert lines == ["5", "6", "7"], checked.stdout
