"""What a first start compiles."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

FIRST_START = """
from numba.core import event
from frictus_service.daemon.preparation import warm_up

class Listed(event.Listener):
    def on_start(self, event):
        function = event.data["dispatcher"].py_func
        print(function.__module__, function.__name__)

    def on_end(self, event):
        pass

with event.install_listener("numba:compile", Listed()):
    warm_up(20_000.0, 100)
"""


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_first_start_compiles_the_rig_and_no_texts(tmp_path: Path) -> None:
    # An expression of whole arrays that might not fit each other brings in Numba's strings,
    # for a message that is never made: twenty seconds of compiling for one of ten.
    started = subprocess.run(
        [sys.executable, "-c", FIRST_START],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    compiled = [line.split() for line in started.stdout.splitlines()]
    assert {"explore", "target_friction", "_observe"} <= {name for _, name in compiled}
    assert not [name for module, name in compiled if module.startswith("numba.cpython.uni")]
