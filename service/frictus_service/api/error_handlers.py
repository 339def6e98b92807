"""What each exception is answered with: the error of the API that stands for it; or nothing."""

import errno
import logging
from typing import Final

import anyio
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.routing import Match
from starlette.types import Message, Receive, Scope, Send

from frictus import errors
from frictus.errors import (
    ArgumentError,
    FrameError,
    LinkError,
    NoRigError,
    RefusedError,
    SilenceError,
    TextureError,
)
from frictus_service import errors as service
from frictus_service.api.http_forms import Middleware
from frictus_service.api.problems import (
    REFUSALS,
    ApiError,
    BusyError,
    CalibrationNotFoundError,
    ConflictError,
    DamagedFileError,
    DiscoveryNotFoundError,
    ExperimentNotFoundError,
    HttpError,
    IdempotencyKeyReusedError,
    InternalError,
    InvalidError,
    MethodNotAllowedError,
    ModelNotFoundError,
    NoAccessError,
    NoLinkError,
    NoRegistryError,
    NotStoredError,
    PathNotFoundError,
    RangeError,
    ReadOnlyError,
    RigCalibratingError,
    RigNotFoundError,
    StudyNotFoundError,
    TextureNotFoundError,
    UnavailableError,
    UnknownOutcomeError,
    UnreadableRigError,
    WrongStateError,
    places,
)
from frictus_service.durable import file_of
from frictus_service.library import (
    DamagedTextureError,
    ReadOnlyTextureError,
    TextureConflictError,
    TextureNameError,
    UnknownTextureError,
)

_LOG: Final = logging.getLogger(__name__)

_FOREIGN: Final[dict[type[Exception], type[ApiError]]] = {
    NoRigError: RigNotFoundError,
    errors.OutcomeUnknownError: UnknownOutcomeError,
    LinkError: NoLinkError,
    SilenceError: NoLinkError,
    FrameError: UnreadableRigError,
    ArgumentError: InvalidError,
    TextureError: InvalidError,
    TextureNameError: InvalidError,
    UnknownTextureError: TextureNotFoundError,
    ReadOnlyTextureError: ReadOnlyError,
    TextureConflictError: ConflictError,
    DamagedTextureError: DamagedFileError,
    service.UnknownStudyError: StudyNotFoundError,
    service.UnknownDiscoveryError: DiscoveryNotFoundError,
    service.UnknownExperimentError: ExperimentNotFoundError,
    service.JobStateError: WrongStateError,
    service.TooManyJobsError: BusyError,
    service.RigInExperimentError: RigCalibratingError,
    service.UnknownModelError: ModelNotFoundError,
    service.UnknownCalibrationError: CalibrationNotFoundError,
    service.AliasConflictError: ConflictError,
    service.KeyReusedError: IdempotencyKeyReusedError,
    service.RigBusyError: RigCalibratingError,
    service.CalibrationStateError: WrongStateError,
    service.RegistryUnavailableError: NoRegistryError,
    service.RegistryError: InvalidError,  # what is left: names, provenance
}
_NOT_STORED: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS})
_CLOSED: Final = frozenset({errno.EACCES, errno.EPERM})
_METHODS: Final = ("DELETE", "GET", "HEAD", "OPTIONS", "PATCH", "POST", "PUT")
_RANGE: Final = (
    "the file has no such part: Range takes bytes=FIRST-LAST, counted from 0, with FIRST not "
    "above LAST and within the file; leave the header out for all of it"
)
_BY_STATUS: Final = {404: PathNotFoundError, 405: MethodNotAllowedError}


def problem_of(error: Exception) -> ApiError:
    """Return the error of the API that stands for any exception."""
    if isinstance(error, ApiError):
        return error
    if isinstance(error, RefusedError):
        return REFUSALS.get(error.code, UnavailableError)(str(error))
    if isinstance(error, RequestValidationError):
        return InvalidError("the request has faults, see errors", places(error.errors()))
    if isinstance(error, HTTPException):
        kind = _BY_STATUS.get(error.status_code, HttpError)
        return kind(_http_detail(error), headers=error.headers)
    for foreign, kind in _FOREIGN.items():
        if isinstance(error, foreign):
            return kind(str(error))
    if isinstance(error, OSError) and error.errno in _NOT_STORED:
        return NotStoredError(
            f"the server cannot write it ({error.strerror}): have its disk freed, or its file "
            "system writable, and ask again"
        )
    if isinstance(error, OSError) and error.errno in _CLOSED:
        return NoAccessError(
            f"the server may not read or write {file_of(error)} "
            f"({error.strerror}): have the account that it runs under given the right to, and "
            "ask again; its log has the whole path"
        )
    return InternalError("an unexpected fault; the server's log has it with this path and time")


def install(app: FastAPI) -> None:
    """Answer every error of `app` with its problem."""

    async def answer(request: Request, error: Exception) -> Response:
        if isinstance(error, HTTPException) and error.status_code == 405:
            error.headers = {"Allow": ", ".join(_allowed(request))}
        problem = problem_of(error)
        if isinstance(problem, (InternalError, NoAccessError)):
            _LOG.error("%s %s failed", request.method, request.url.path, exc_info=error)
        return problem.response(request.url.path)

    for kind in (ApiError, RefusedError, RequestValidationError, HTTPException, Exception):
        app.add_exception_handler(kind, answer)
    for foreign in (*_FOREIGN, OSError):
        app.add_exception_handler(foreign, answer)


class Departures(Middleware):
    """ASGI middleware: a client that leaves its stream of events is no fault of the server.

    FastAPI then raises what its keep-alive met, an end of its own stream.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request until its client has all of the answer, or has left."""
        try:
            await self._app(scope, receive, send)
        except* anyio.BrokenResourceError:
            _LOG.info("%s: its client left", scope["path"])


class UnsatisfiableRanges(Middleware):
    """ASGI middleware: a `Range` that a file does not have is answered with a problem.

    Starlette answers with bare text, 400 where the header cannot be read.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request."""
        if scope["type"] != "http" or "range" not in Headers(scope=scope):
            await self._app(scope, receive, send)
            return
        refused = False

        async def sent(message: Message) -> None:
            nonlocal refused
            if message["type"] == "http.response.start" and message["status"] in (400, 416):
                given = Headers(raw=message["headers"])
                refused = given.get("content-type", "").startswith("text/plain")
                if refused:
                    whole = given.get("content-range")
                    headers = {} if whole is None else {"Content-Range": whole}
                    problem = RangeError(_RANGE, headers=headers)
                    await problem.response(scope["path"])(scope, receive, send)
            if not refused:
                await send(message)

        await self._app(scope, receive, sent)


def _allowed(request: Request) -> list[str]:
    """Return the methods of a path; Starlette names those of its first route only."""
    allowed = {
        method
        for method in _METHODS
        if any(
            route.matches({**request.scope, "method": method})[0] is Match.FULL
            for route in request.app.router.routes
        )
    }
    return sorted(allowed | ({"HEAD"} if "GET" in allowed else set()))


def _http_detail(error: HTTPException) -> str:
    if error.status_code == 404:
        return "nothing is served at this path; /docs lists what is"
    if error.status_code == 405:
        allowed = (error.headers or {}).get("Allow", "")
        return f"this path accepts {allowed}" if allowed else "this path has other methods"
    return str(error.detail)
