"""The process of a job ends where whoever started it stands still: its trial must not go on."""

import queue
import subprocess
import sys
from pathlib import Path

import pytest
from tests.service.jobs.chatty import ChattyWork, FilelessWork

from frictus_service.jobs.process import ParentLink
from frictus_service.jobs.worker import STILL_S, _carry_out


@pytest.mark.long
def test_a_job_that_nobody_listens_to_ends(tmp_path: Path) -> None:
    work = ChattyWork(run="tests.service.jobs.chatty:never", folder=tmp_path)
    command = [
        *(sys.executable, "-m", "frictus_service.jobs.worker"),
        "tests.service.jobs.chatty:ChattyWork",
    ]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=Path(__file__).parents[3]
    ) as process:
        assert process.stdin is not None
        process.stdin.write(work.model_dump_json().encode() + b"\n")
        process.stdin.flush()
        # Its output is held open, and not read; its input does not end.
        assert process.wait(STILL_S + 60.0) == 1
    assert int((tmp_path / "told").read_text("ascii")) > 10


def test_a_file_that_has_gone_is_no_unexpected_fault(tmp_path: Path) -> None:
    work = FilelessWork(run="tests.service.jobs.chatty:never", folder=tmp_path)
    parent = ParentLink(lambda _: None, queue.SimpleQueue(), lambda: False)
    last = _carry_out(work, parent)
    assert (last.kind, "unexpected" in last.data) == ("failed", False)
    assert last.data.startswith("gone.h5 could not be read or written (No such file")
    assert str(tmp_path) not in last.data  # whoever may read the job need not know the disk
