"""The paths that every kind of job has: where it stands, its events, cancel, resume.

The events of a job are a stream, until it runs no more.
"""

from collections.abc import AsyncIterator, Callable, Sequence
from typing import Annotated, Any, Final, Generic, Protocol

import anyio
from fastapi import APIRouter, Depends, Header, Path, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.sse import EventSourceResponse, ServerSentEvent

from frictus.names import Matching
from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.limits import RequestLimits
from frictus_service.api.services import Given, Services
from frictus_service.config import Scope
from frictus_service.errors import UnknownJobError
from frictus_service.jobs.engine import Job, JobEngine

LOOK_S: Final = 0.2
"""How often a stream of events looks for more."""
LastEventId = Annotated[int, Header(ge=0, le=2**31 - 1, description="Begin behind this event")]
"""What a client that comes back has heard already."""
_ID: Final = Matching(
    r"^[0-9a-f-]{1,64}$",
    "1 to 64 digits, letters a to f and '-' are accepted: take an id of the list",
)
Problems = tuple[type[problems.ApiError], ...]
ASKED: Final[Problems] = (problems.UnauthenticatedError, problems.MissingScopeError)
"""Problems of any path that a token opens."""
BODY: Final[Problems] = (problems.TooLargeError, problems.UnsupportedMediaError)
"""Problems of any path that takes a body."""


class Event(Protocol):
    """One thing that a job told."""

    @property
    def number(self) -> int:
        """From 1, without gaps."""

    @property
    def kind(self) -> str:
        """``state`` or ``progress``."""

    @property
    def data(self) -> str:
        """JSON."""


async def place(
    request: Request, person: Annotated[str, Depends(needs("read"))]
) -> AsyncIterator[None]:
    """Hold one of the places for streams of events while a request is served; a dependency."""
    limits: RequestLimits = request.app.state.limits
    with limits.streams.held(person):
        yield


def id_of(kind: str) -> Any:
    """Return the declaration of the id in the path of a job."""
    declared = Path(alias=kind, description=f"Id of the {kind}, as it was made")
    # Where a declaration is a default, FastAPI passes over what an Annotated says besides.
    declared.metadata.append(_ID)
    return declared


class JobRoutes(Generic[Job]):
    """The paths of one kind of job; each `add` declares one.

    Parameters
    ----------
    kind, plural : str
        What a job is called, and what the first part of the paths is, such as ``discoveries``.
    document : type
        Says where a job stands.
    engine : callable
        Returns what runs the jobs, of the services.
    missing : type
        Problem where there is no such job.
    more : tuple of types
        Other problems of any path.

    Attributes
    ----------
    router : APIRouter
        Of all of them, those that a kind adds itself too.
    read, write : tuple of types
        Problems of the paths that read a job, and of those that change one.
    existing : Depends
        The job that a path names.
    """

    def __init__(
        self,
        kind: str,
        plural: str,
        document: type[Job],
        engine: Callable[[Services], JobEngine[Job]],
        missing: type[problems.ApiError],
        *more: type[problems.ApiError],
    ) -> None:
        self.router = APIRouter(prefix=f"/v1/{plural}", tags=[plural])
        self.read: Problems = (*ASKED, problems.InvalidError, missing, *more)
        self.write: Problems = (
            *self.read,
            problems.WrongStateError,
            problems.NotStoredError,
        )
        self._kind, self._document, self._engine = kind, document, engine
        self._id = id_of(kind)

        def existing(given: Given, job: str = self._id) -> Job:
            return engine(given).get(job)

        self.existing: Any = Depends(existing)

    def add_get(self, description: str) -> None:
        """Declare the path that says where a job stands.

        Parameters
        ----------
        description : str
            Of the path, in the reference.
        """

        def get(found: Any = self.existing) -> Any:
            return found

        self._add("GET", "", get, "get", description, "read", self.read)

    def add_events(
        self, events: Callable[[Services], Callable[[str, int], Sequence[Event]]]
    ) -> None:
        """Declare the stream of what a job tells.

        Parameters
        ----------
        events : callable
            Returns, of the services, what gives the events of a job behind a number.
        """
        engine = self._engine

        async def follow_job(
            given: Given, found: Any = self.existing, last_event_id: LastEventId = 0
        ) -> AsyncIterator[ServerSentEvent]:
            jobs, number = engine(given), last_event_id

            def look() -> tuple[bool, Sequence[Event]]:
                # First the state: what was told before it changed is then among the events.
                try:
                    active = jobs.is_active(found.id)
                except UnknownJobError:  # its folder was deleted: GET says so from now on
                    active = False
                return active, events(given)(found.id, number)

            while not jobs.closing:
                active, told = await run_in_threadpool(look)
                for event in told:
                    number = event.number
                    yield ServerSentEvent(raw_data=event.data, event=event.kind, id=str(number))
                if not told:
                    if not active:
                        return
                    await anyio.sleep(LOOK_S)

        self.router.add_api_route(
            f"/{{{self._kind}}}/events",
            follow_job,
            name=f"follow_{self._kind}",
            description=f"Follow a {self._kind}: `state` and `progress` events, from the first "
            f"one on.\n\nThe stream ends when the {self._kind} does not run any more. After a "
            "break, `Last-Event-ID`\ngives what was missed.",
            dependencies=[Depends(needs("read")), Depends(place)],
            response_class=EventSourceResponse,
            responses=problems.documented(*self.read),
        )

    def add_cancel(self, description: str) -> None:
        """Declare the path that cancels a job.

        Parameters
        ----------
        description : str
            Of the path, in the reference.
        """
        engine = self._engine

        def cancel(given: Given, job: str = self._id) -> Any:
            return engine(given).cancel(job)

        self._add("DELETE", "", cancel, "cancel", description, "calibrate", self.write)

    def add_resume(self, description: str) -> None:
        """Declare the path that goes on with a job which has ended early, on a rig.

        Parameters
        ----------
        description : str
            Of the path, in the reference.
        """
        engine = self._engine

        def resume(given: Given, job: str = self._id) -> Any:
            return engine(given).resume(job)

        may = (*self.write, problems.RigCalibratingError)
        self._add("POST", "/resume", resume, "resume", description, "calibrate", may)

    def _add(
        self,
        method: str,
        path: str,
        endpoint: Callable[..., Any],
        verb: str,
        description: str,
        scope: Scope,
        may: Problems,
    ) -> None:
        self.router.add_api_route(
            f"/{{{self._kind}}}{path}",
            endpoint,
            methods=[method],
            status_code=None if method == "GET" else 202,
            name=f"{verb}_{self._kind}",
            description=description,
            dependencies=[Depends(needs(scope))],
            response_model=self._document,
            responses=problems.documented(*may),
        )
