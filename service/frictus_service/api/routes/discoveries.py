"""Paths of discoveries: started, followed by events, cancelled, and their reports."""

from typing import Annotated

from fastapi import Depends, Response
from fastapi.responses import FileResponse

from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.requests import body_of, json_body
from frictus_service.api.routes.jobs import ASKED, BODY, JobRoutes
from frictus_service.api.services import Given
from frictus_service.discovery.across_studies.document import AcrossStudies
from frictus_service.discovery.document import DOCUMENT, REPORT, Discovery
from frictus_service.discovery.jobs import DiscoveryJob, DiscoveryJobs, DiscoverySpec

jobs = JobRoutes(
    "discovery",
    "discoveries",
    DiscoveryJob,
    lambda given: given.discoveries,
    problems.DiscoveryNotFoundError,
)
router = jobs.router


@router.post(
    "",
    status_code=202,
    responses=problems.documented(
        *ASKED,
        problems.InvalidError,
        problems.StudyNotFoundError,
        problems.NotStoredError,
        *BODY,
    ),
    openapi_extra=body_of(DiscoverySpec),
)
def start_discovery(
    given: Given,
    by: Annotated[str, Depends(needs("calibrate"))],
    response: Response,
    spec: Annotated[DiscoverySpec, json_body(DiscoverySpec, extra=None)],
) -> DiscoveryJob:
    """Find out what a model gets wrong in a study, or in several; `Location` follows it.

    One runs at a time; others wait for their turn.
    """
    job = given.discoveries.start(spec, by)
    response.headers["Location"] = f"/v1/discoveries/{job.id}"
    return job


@router.get("", dependencies=[Depends(needs("read"))], responses=problems.documented(*ASKED))
def list_discoveries(given: Given) -> DiscoveryJobs:
    """List the discoveries in this machine's folder of studies, newest first."""
    return DiscoveryJobs(discoveries=given.discoveries.store.all())


jobs.add_get("Return where a discovery stands: state, progress, verdict.")
jobs.add_events(lambda given: given.discoveries.store.events)
jobs.add_cancel(
    "Cancel a discovery; it ends within moments. What trials said is kept for the next one."
)


def finished(found: Annotated[DiscoveryJob, jobs.existing]) -> DiscoveryJob:
    """Return a discovery that has a report; a dependency."""
    if found.state != "done":
        raise problems.WrongStateError(
            f"discovery {found.id} is {found.state}: there is a report once it is done"
        )
    return found


Finished = Annotated[DiscoveryJob, Depends(finished)]


@router.get(
    "/{discovery}/report",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*jobs.write),
)
def get_report(found: Finished, given: Given) -> Discovery | AcrossStudies:
    """Return the report: causes, what is unexplained, the extended model (`discovery/1`).

    Of several studies: what holds in all, and what differs (`across-studies/1`).
    """
    document = (given.discoveries.store.folder(found.id) / DOCUMENT).read_bytes()
    if isinstance(found.spec.study, str):
        return Discovery.model_validate_json(document)
    return AcrossStudies.model_validate_json(document)


@router.get(
    "/{discovery}/report.html",
    dependencies=[Depends(needs("read"))],
    response_class=FileResponse,
    responses=problems.documented(*jobs.write),
)
def get_page(found: Finished, given: Given) -> FileResponse:
    """Return the report as a page with figures."""
    path = given.discoveries.store.folder(found.id) / REPORT
    return FileResponse(path, media_type="text/html")
