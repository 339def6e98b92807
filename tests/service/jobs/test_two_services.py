"""Two services that work in one folder: each runs its own jobs, however the other one ends."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest

from frictus_service.calibration.job import CalibrationSpec
from frictus_service.config import Config, RegistryConfig
from frictus_service.discovery.jobs import DiscoverySpec, DiscoveryStore
from frictus_service.errors import CalibrationStateError, JobElsewhereError
from frictus_service.job_folder import ACTIVE
from frictus_service.job_locks import hold, let_go
from frictus_service.jobs.calibrations import CalibrationEngine, HeldCalibrations
from frictus_service.jobs.engine import RigUse
from frictus_service.registry.store import Registry

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
CALIBRATES = """
import sys
from pathlib import Path
from frictus_service.jobs.calibrations import HeldCalibrations
from frictus_service.registry.store import Registry
with Registry(sys.argv[2]) as registry:
    held = HeldCalibrations(registry.calibrations, Path(sys.argv[1]))
    held.change(sys.argv[3], "running", of=("queued",))
    print("runs", flush=True)
    if sys.stdin.readline():
        held.change(sys.argv[3], "cancelled", of=("running",))
        print("ended", flush=True)
        sys.stdin.readline()
"""


@contextmanager
def service(code: str, *given: str) -> Iterator[tuple[subprocess.Popen[str], IO[str], IO[str]]]:
    """Run another service; give it, its input and its output."""
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", code, *given]
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as other:
        assert other.stdin is not None
        assert other.stdout is not None
        yield other, other.stdin, other.stdout


@pytest.mark.parametrize("killed", [True, False])
def test_a_calibration_is_its_service_s_until_that_ends_or_the_calibration_does(
    killed: bool, tmp_path: Path
) -> None:
    """Whoever started next made it interrupted while it ran; resumed, it ran twice at once."""
    url = f"sqlite:///{(tmp_path / 'frictus.db').as_posix()}"
    config = Config(studies=tmp_path / "studies", registry=RegistryConfig(url=url))
    with Registry(url) as registry:
        kept = registry.calibrations
        spec = CalibrationSpec(rig="rig1", participant="P01", seed=7)
        job = kept.create(spec, site="lab", by="ann")[0].id
        with service(CALIBRATES, str(config.studies), url, job) as (other, tell, said):
            assert said.readline() == "runs\n"
            engine = CalibrationEngine(config, registry, RigUse())
            assert engine.get(job).state == "running"
            with pytest.raises(JobElsewhereError, match=f"{job} is run by another API"):
                engine.cancel(job)
            with pytest.raises(CalibrationStateError, match="is running"):
                engine.resume(job)
            if killed:
                other.kill()
                other.wait()
                HeldCalibrations(kept, config.studies).interrupt("lab")
                assert engine.get(job).state == "interrupted"
                assert engine.cancel(job).state == "cancelled"
            else:
                tell.write("\n")
                tell.flush()
                assert said.readline() == "ended\n"
                assert engine.get(job).state == "cancelled"
                with pytest.raises(CalibrationStateError, match="is cancelled"):
                    engine.cancel(job)
                other.kill()
            engine.close()


@pytest.mark.parametrize("killed", [True, False])
def test_a_job_is_its_service_s_until_that_ends_or_the_job_does(
    killed: bool, tmp_path: Path
) -> None:
    """It was noted as interrupted by whoever started next, and its result was lost."""
    (tmp_path / STUDY).touch()
    store = DiscoveryStore(tmp_path)
    with service(QUEUES, str(tmp_path), STUDY) as (other, tell, said):
        job = said.readline().strip()
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
            tell.write("\n")
            tell.flush()
            assert said.readline() == "done\n"
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
