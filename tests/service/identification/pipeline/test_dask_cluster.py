"""A real cluster, in processes of its own, does the same work, and a death loses nothing."""

import logging
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.identification.tasks import die_at_minus_one, die_first
from tests.service.identification.trials import STUDY, Made, numbered, trial

from frictus_service.identification.pipeline.dask_cluster import ClusterError, work_on_cluster
from frictus_service.identification.pipeline.study import observe_study
from frictus_service.identification.pipeline.workers import Crash
from frictus_service.processes import free_port
from frictus_service.study.writer import StudyWriter

pytestmark = pytest.mark.long

dask: Any = pytest.importorskip("dask")
distributed: Any = pytest.importorskip("distributed")

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with (
        pytest.MonkeyPatch.context() as patch,
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
    ):
        patch.syspath_prepend(ROOT)  # for its workers, which import the tasks
        with distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            dashboard_address=":0",
            silence_logs=logging.CRITICAL,
        ) as cluster:
            yield cluster.scheduler_address


def nothing() -> None:
    pass


def silent(_: str) -> None:
    pass


def test_a_study_on_a_cluster(address: str, tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "study.h5"
    with StudyWriter(path, STUDY) as writer:
        for number in range(4):
            writer.add(numbered(trial(Made(seconds=1.2, noise_n=0.002), rng), number))
    told: list[str] = []
    here = observe_study(path, workers=0)
    there = observe_study(path, cluster=address, cache=tmp_path / "cache", tell=told.append)
    assert f"2 threads of the cluster at {address} work" in told
    for one, other in zip(here, there, strict=True):
        assert one.info == other.info
        assert one.sha256 == other.sha256
        np.testing.assert_array_equal(one.rows.friction_response, other.rows.friction_response)
    again = observe_study(path, workers=0, cache=tmp_path / "cache", tell=told.append)
    assert told[-1] == "4 trials, 4 of them known already"
    assert [each.sha256 for each in again] == [each.sha256 for each in here]


def test_a_worker_killed_at_work_loses_nothing(address: str, tmp_path: Path) -> None:
    markers = [tmp_path / str(number) for number in range(12)]
    for marker in markers[1:]:
        marker.touch()
    done = dict(work_on_cluster(address, die_first, markers, silent, nothing))
    assert done == dict.fromkeys(range(12), "done")


def test_a_task_that_kills_its_workers_is_told(address: str) -> None:
    done = dict(work_on_cluster(address, die_at_minus_one, [1, -1, 2], silent, nothing))
    assert done[0] == 1
    assert done[2] == 2
    assert isinstance(done[1], Crash)


def test_nobody_answers() -> None:
    with pytest.raises(ClusterError, match=r"no dask scheduler answers at tcp://127.*dask"):
        list(
            work_on_cluster(
                f"tcp://127.0.0.1:{free_port()}", abs, [1], silent, nothing, timeout_s=0.5
            )
        )


def test_nobody_works() -> None:
    with distributed.LocalCluster(n_workers=0, dashboard_address=":0") as idle:
        address = idle.scheduler_address
        with pytest.raises(ClusterError, match="has no workers"):
            list(work_on_cluster(address, abs, [1], silent, nothing, timeout_s=5.0))


def test_without_distributed_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ClusterError, match=r"frictus\[cluster\]"):
        list(work_on_cluster("tcp://127.0.0.1:1", abs, [1], silent, nothing))
