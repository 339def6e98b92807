"""What each process loads: a start takes as long as what it imports."""

import subprocess
import sys

import pytest

COMPILER = {"numba", "scipy"}


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
def test_no_process_but_the_rig_loads_the_compiler(module: str) -> None:
    program = f"import sys\nimport {module}\nprint(*({COMPILER!r} & sys.modules.keys()))"
    loaded = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    assert loaded.stdout.split() == []
