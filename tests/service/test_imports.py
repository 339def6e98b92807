"""What each process loads: a start takes as long as what it imports."""

import subprocess
import sys

import pytest

SLOW = {"numba", "scipy", "matplotlib", "alembic"}
"""The compiler, and what else takes a good part of a second to load."""


@pytest.mark.parametrize(
    "module",
    [
        "frictus_service.config",
        "frictus_service.daemon.processes.supervisor",
        "frictus_service.daemon.processes.child_process",
        "frictus_service.recording.recorder",
        "frictus_service.api.server",
        "frictus_service.cli.demo_page",
    ],
)
def test_no_process_but_rig_and_tracker_loads_what_is_slow(module: str) -> None:
    program = f"import sys\nimport {module}\nprint(*({SLOW!r} & sys.modules.keys()))"
    loaded = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    assert loaded.stdout.split() == []
