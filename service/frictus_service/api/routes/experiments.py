"""Paths of experiments: started, followed, answered, paused, resumed, and what they say."""

from collections.abc import AsyncIterator
from itertools import islice
from typing import Annotated, Final

import anyio
from fastapi import Depends, Query, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.sse import EventSourceResponse, ServerSentEvent

from frictus.experiment import events_table
from frictus_service.api import problems
from frictus_service.api.access import has, needs
from frictus_service.api.requests import body_of, json_body
from frictus_service.api.routes.jobs import ASKED, BODY, JobRoutes, id_of, place
from frictus_service.api.services import Given
from frictus_service.errors import UnknownExperimentError
from frictus_service.experiments.job import (
    LOG,
    Answer,
    ExperimentJob,
    ExperimentList,
    ExperimentSpec,
    ready_list,
)
from frictus_service.experiments.report import ExperimentReport, report, rows_of
from frictus_service.job_folder import ACTIVE

Unveiled = Annotated[bool, Depends(has("calibrate"))]
"""Whether whoever asks may see what is played; participants, who read and answer, may not."""
LOOK_S: Final = 0.05
"""How often a stream looks for something else to show; what is seen is late by it."""
jobs = JobRoutes(
    "experiment",
    "experiments",
    ExperimentJob,
    lambda given: given.experiments,
    problems.ExperimentNotFoundError,
)
router = jobs.router
Id = Annotated[str, id_of("experiment")]
Existing = Annotated[ExperimentJob, jobs.existing]


@router.post(
    "",
    status_code=202,
    responses=problems.documented(
        *ASKED,
        problems.InvalidError,
        problems.RigNotFoundError,
        problems.NoLinkError,
        problems.RigCalibratingError,
        problems.NotStoredError,
        *BODY,
    ),
    openapi_extra=body_of(ExperimentSpec),
)
def start_experiment(
    given: Given,
    by: Annotated[str, Depends(needs("calibrate"))],
    response: Response,
    spec: Annotated[ExperimentSpec, json_body(ExperimentSpec, extra=None)],
) -> ExperimentJob:
    """Start an experiment, which **arms the rig**; `Location` is where it can be followed.

    One runs on a rig at a time. Nothing is felt before the participant has answered `go`.
    """
    given.link.rig(spec.rig)  # 404 now, rather than an experiment that fails
    job = given.experiments.start(spec, by)
    response.headers["Location"] = f"/v1/experiments/{job.id}"
    return job


@router.get(
    "",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*ASKED, problems.InvalidError),
)
def list_experiments(
    given: Given,
    unveiled: Unveiled,
    rig: Annotated[str | None, Query(max_length=64)] = None,
    limit: Annotated[int, Query(ge=1, le=1_000)] = 100,
) -> ExperimentList:
    """List the experiments of this machine, newest first, and the protocols that are ready."""
    experiments = given.experiments
    found = (job for job in experiments.store.newest() if rig in (None, job.rig))
    shown = [experiments.with_screen(job) for job in islice(found, limit)]
    return ExperimentList(
        experiments=[job if unveiled else job.veiled() for job in shown],
        more=next(found, None) is not None,
        ready=ready_list(),
    )


@router.get(
    "/{experiment}",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*jobs.read),
)
def get_experiment(found: Existing, unveiled: Unveiled) -> ExperimentJob:
    """Return where an experiment stands, and what the participant's page shows now.

    Seed, condition and level are told to who may calibrate alone.
    """
    return found if unveiled else found.veiled()


@router.get(
    "/{experiment}/events",
    dependencies=[Depends(needs("read")), Depends(place)],
    response_class=EventSourceResponse,
    responses=problems.documented(*jobs.read),
)
async def follow_experiment(
    found: Existing, given: Given, unveiled: Unveiled
) -> AsyncIterator[ServerSentEvent]:
    """Follow an experiment: `state` events, each with all that GET answers.

    The first comes at once. What changes faster than it is read is left out. The stream ends
    when the experiment runs no more.
    """
    experiments = given.experiments
    seen, told = -1, ""
    while not experiments.closing:
        if (now := experiments.changes) != seen:
            seen = now
            try:
                found = await run_in_threadpool(experiments.get, found.id)
            except UnknownExperimentError as gone:  # GET says 404 from now on
                end = {"state": "failed", "failure": str(gone), "screen": None}
                found = found.model_copy(update=end)
            shown = found if unveiled else found.veiled()
            if (data := shown.model_dump_json(by_alias=True)) != told:
                told = data
                yield ServerSentEvent(raw_data=data, event="state", id=str(now))
            if found.state not in ACTIVE:
                return
        await anyio.sleep(LOOK_S)


@router.get(
    "/{experiment}/report",
    dependencies=[Depends(needs("calibrate"))],
    responses=problems.documented(*jobs.write),
)
def get_report(
    found: Existing,
    given: Given,
    most: Annotated[int, Query(ge=1, le=10_000, description="Newest trials listed")] = 200,
) -> ExperimentReport:
    """Return what its trials say so far: the newest of them, thresholds, curves, in words."""
    store = given.experiments.store
    rows = rows_of(store.folder(found.id) / LOG)
    return report(store.protocol(found.id), rows, most)


@router.get(
    "/{experiment}/events.tsv",
    dependencies=[Depends(needs("calibrate"))],
    response_class=Response,
    responses={
        200: {"content": {"text/tab-separated-values": {}}},
        **problems.documented(*jobs.read),
    },
)
def get_events_table(found: Existing, given: Given) -> Response:
    """Return the answered trials as a table of events (BIDS 1.10)."""
    table = events_table(rows_of(given.experiments.store.folder(found.id) / LOG))
    return Response(table, media_type="text/tab-separated-values; charset=utf-8")


@router.post(
    "/{experiment}/answers",
    status_code=202,
    dependencies=[Depends(needs("render"))],
    responses=problems.documented(*jobs.write, *BODY),
    openapi_extra=body_of(Answer),
)
def answer(
    experiment: Id,
    given: Given,
    unveiled: Unveiled,
    answered: Annotated[Answer, json_body(Answer)],
) -> ExperimentJob:
    """Answer the question that is on the screen; each takes one answer.

    Accepted are the keys of the task; `go` where the participant is to begin or has a break.
    """
    found = given.experiments.answer(experiment, answered)
    return found if unveiled else found.veiled()


@router.post(
    "/{experiment}/pause",
    status_code=202,
    dependencies=[Depends(needs("calibrate"))],
    responses=problems.documented(*jobs.write),
)
def pause_experiment(experiment: Id, given: Given) -> ExperimentJob:
    """Have a pause before the next trial; the screen is smooth, the rig stays armed."""
    return given.experiments.pause(experiment)


jobs.add_resume(
    "Go on after a pause; or, where it ended early, with the trial that would have come."
)
jobs.add_cancel(
    "Stop an experiment; it ends, the rig disarmed, within moments. Its trials are kept."
)
