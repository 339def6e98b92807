"""Two services that work in one folder: each runs its own jobs, however the other one ends."""

import subprocess
import sys
from pathlib import Path

import pytest

from frictus_service.discovery.jobs import DiscoverySpec, DiscoveryStore
from frictus_service.errors import JobElsewhereError
from frictus_service.job_folder import ACTIVE
from frictus_service.job_locks import hold, let_go

STUDY = "visit1.h5"
MANY = 3_000
"""That wait: more than a process has files."""
QUEUES = """
import sys
from pathlib import Path
from frictus_service.discovery.jobs import DiscoverySpec, DiscoveryStore
store = DiscoveryStore(Path(sys.argv[1]))
job = store.create(DiscoverySpec(study=sys.argv[2]), "ann").id
print(job, flush=True)
if sys.stdin.readline():
    store.change(job, "done", of=("queued",))
    print("done", flush=True)
    sys.stdin.readline()
"""


@pytest.mark.parametrize("killed", [True, False])
def test_a_job_is_its_service_s_until_that_ends_or_the_job_does(
    killed: bool, tmp_path: Path
) -> None:
    """It was noted as interrupted by whoever started next, and its result was lost."""
    (tmp_path / STUDY).touch()
    store = DiscoveryStore(tmp_path)
    other = subprocess.Popen(
        [sys.executable, "-c", QUEUES, str(tmp_path), STUDY],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with other:
        assert other.stdin is not None
        assert other.stdout is not None
        job = other.stdout.readline().strip()
        own = store.create(DiscoverySpec(study=STUDY), "ben").id
        store.interrupt()
        assert (store.state(job), store.state(own)) == ("queued", "interrupted")
        with pytest.raises(JobElsewhereError, match=f"{job} is run by another API"):
            store.change(job, "cancelled", of=ACTIVE)
        if killed:
            other.kill()
            other.wait()
            store.interrupt()
            assert store.state(job) == "interrupted"
        else:
            other.stdin.write("\n")
            other.stdin.flush()
            assert other.stdout.readline() == "done\n"
            assert store.change(job, "interrupted", of=("done",)).state == "interrupted"
            other.kill()


@pytest.mark.skipif(not Path("/dev/fd").is_dir(), reason="its files cannot be counted")
def test_many_that_wait_take_one_file(tmp_path: Path) -> None:
    before = len(list(Path("/dev/fd").iterdir()))
    jobs = [f"job-{number}" for number in range(MANY)]
    assert all(hold(tmp_path / "jobs", job) for job in jobs)
    assert len(list(Path("/dev/fd").iterdir())) <= before + 1
    for job in jobs:
        let_go(tmp_path / "jobs", job)
    assert len(list(Path("/dev/fd").iterdir())) <= before
