"""Every error of the REST API: one class each, which owns its status and its stable word.

All are answered as ``application/problem+json`` (RFC 9457). `docs/rest.md` has the table.
"""

import json
from collections.abc import Mapping
from typing import Any, ClassVar, Final, get_args

from fastapi.responses import Response
from pydantic import BaseModel, Field
from pydantic_core import ErrorDetails

from frictus.errors import complaint
from frictus.messages import RefusalCode

MEDIA_TYPE: Final = "application/problem+json"


class Place(BaseModel):
    """One fault of a request and where it stands."""

    where: list[str | int] = Field(description="Path to it, such as ['body', 'regions', 0]")
    what: str


class Problem(BaseModel):
    """The body of every error."""

    type: str = Field(description="urn:frictus:problem: and the code")
    title: str
    status: int
    code: str = Field(description="Stable word for programs")
    detail: str = Field(description="What was wrong, what is accepted, what to do")
    instance: str = Field(description="Path of the request")
    errors: list[Place] = []


class ApiError(Exception):
    """Base of all errors that the API answers with."""

    status: ClassVar[int]
    code: ClassVar[str]
    title: ClassVar[str]

    def __init__(
        self,
        detail: str,
        errors: list[Place] | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(detail)
        self.detail = detail
        self.errors = errors or []
        self.headers = dict(headers or {})

    def response(self, path: str) -> Response:
        """Return the answer to the request for `path`."""
        problem = Problem(
            type=f"urn:frictus:problem:{self.code}",
            title=self.title,
            status=self.status,
            code=self.code,
            detail=self.detail,
            instance=path,
            errors=self.errors,
        )
        body = json.dumps(problem.model_dump(exclude_defaults=True))
        return Response(body, self.status, self.headers, MEDIA_TYPE)


class HttpError(ApiError):
    """The request cannot be read at all."""

    status, code, title = 400, "bad_http", "The request is not HTTP as expected"


class UnauthenticatedError(ApiError):
    """No token, or an unknown one."""

    status, code, title = 401, "unauthenticated", "A bearer token is needed"


class MissingScopeError(ApiError):
    """The token may not do this."""

    status, code, title = 403, "missing_scope", "The token lacks a scope"


class CrossOriginError(ApiError):
    """A web page of another origin tried to change something."""

    status, code, title = 403, "cross_origin", "Requests from other origins are refused"


class PathNotFoundError(ApiError):
    """Nothing is served there."""

    status, code, title = 404, "no_such_path", "No such path"


class RigNotFoundError(ApiError):
    """No rig of this name answers."""

    status, code, title = 404, "no_rig", "No such rig"


class NoEstimateError(ApiError):
    """Nobody tracks the finger on this rig, or nothing was felt yet."""

    status, code, title = 404, "no_estimate", "No estimate"


class TextureNotFoundError(ApiError):
    """The library has no texture of this name."""

    status, code, title = 404, "no_texture", "No such texture"


class ModelNotFoundError(ApiError):
    """The registry has no such model, version or alias."""

    status, code, title = 404, "no_model", "No such model"


class CalibrationNotFoundError(ApiError):
    """The registry has no such calibration."""

    status, code, title = 404, "no_calibration", "No such calibration"


class StudyNotFoundError(ApiError):
    """The folder of studies has no such file."""

    status, code, title = 404, "no_study", "No such study"


class RecordingNotFoundError(ApiError):
    """The folder of recordings has no such file."""

    status, code, title = 404, "no_recording", "No such recording"


class DiscoveryNotFoundError(ApiError):
    """There is no discovery of this id."""

    status, code, title = 404, "no_discovery", "No such discovery"


class ExperimentNotFoundError(ApiError):
    """There is no experiment of this id."""

    status, code, title = 404, "no_experiment", "No such experiment"


class MethodNotAllowedError(ApiError):
    """The path knows other methods."""

    status, code, title = 405, "method_not_allowed", "Method not allowed"


class NotOwnerError(ApiError):
    """Another client holds the rig."""

    status, code, title = 409, "not_owner", "Another client holds the rig"


class RigNotArmedError(ApiError):
    """The rig must be armed for this."""

    status, code, title = 409, "not_armed", "The rig is not armed"


class TrippedError(ApiError):
    """The rig has tripped and waits for an operator."""

    status, code, title = 409, "tripped", "The rig has tripped"


class ReadOnlyError(ApiError):
    """Shipped textures stay as they are."""

    status, code, title = 409, "read_only", "The texture is read-only"


class RecordingConflictError(ApiError):
    """Another recording is under way or bears the name, or none is under way."""

    status, code, title = 409, "recording_conflict", "Not with what is being recorded"


class StudyExistsError(ApiError):
    """A study of this name is there."""

    status, code, title = 409, "study_exists", "There is a study of this name"


class RigCalibratingError(ApiError):
    """A calibration or an experiment is under way on the rig."""

    status, code, title = 409, "rig_busy", "The rig is being used"


class WrongStateError(ApiError):
    """The calibration, discovery or experiment is not in a state that allows this."""

    status, code, title = 409, "wrong_state", "It is in another state"


class ConflictError(ApiError):
    """What was to be replaced is not what the caller saw."""

    status, code, title = 412, "conflict", "It has changed since it was read"


class TooLargeError(ApiError):
    """The body is larger than what is read."""

    status, code, title = 413, "too_large", "The body is too large"


class SlowBodyError(ApiError):
    """The body does not come."""

    status, code, title = 408, "slow_body", "The body did not come in time"


class GoneError(ApiError):
    """Whoever asked left before the whole body was here; nobody reads this."""

    status, code, title = 400, "client_gone", "The client left"


class TooOftenError(ApiError):
    """One address asks more often than it is answered."""

    status, code, title = 429, "too_often", "Too many requests"


class BusyError(ApiError):
    """As much is done at once as can be."""

    status, code, title = 503, "busy", "Too much is asked at once"


class UnsupportedMediaError(ApiError):
    """The body is of a type that cannot be read here."""

    status, code, title = 415, "unsupported_media_type", "Unsupported content type"


class WrongHostError(ApiError):
    """The Host header names another machine: a rebound DNS name."""

    status, code, title = 421, "wrong_host", "The Host header is not this server"


class RangeError(ApiError):
    """A part of a file is asked for that it does not have."""

    status, code, title = 416, "bad_range", "No such part of the file"


class InvalidError(ApiError):
    """The request can be read, but a value is missing, of the wrong type or out of range."""

    status, code, title = 422, "bad_request", "The request is not valid"


class NotFeasibleError(ApiError):
    """The rig cannot render it."""

    status, code, title = 422, "not_feasible", "It cannot be rendered"


class IdempotencyKeyReusedError(ApiError):
    """The idempotency key came with another request before."""

    status, code, title = 422, "key_reused", "The idempotency key was used before"


class PreconditionRequiredError(ApiError):
    """The request does not say what it replaces."""

    status, code, title = 428, "precondition_required", "If-Match is required"


class InternalError(ApiError):
    """A fault of the server; its log has the traceback."""

    status, code, title = 500, "internal", "The server failed"


class DamagedFileError(ApiError):
    """A file in the library folder is not a texture."""

    status, code, title = 500, "damaged_texture", "A file of the library is damaged"


class NoAccessError(ApiError):
    """The service may not use its own files."""

    status, code, title = 500, "no_access", "The service may not use its files"


class UnreadableRigError(ApiError):
    """A rig said something that is not of this protocol, or of a newer version."""

    status, code, title = 502, "rig_unreadable", "The rig cannot be understood"


class NoLinkError(ApiError):
    """No router can be reached, or the rig does not answer."""

    status, code, title = 503, "no_link", "No link to the router or the rig"


class UnknownOutcomeError(ApiError):
    """The rig got the request and has not answered: it may have done it, or may still do it."""

    status, code, title = 504, "outcome_unknown", "Whether it was done is not known"


class NoRegistryError(ApiError):
    """The registry's database cannot be used."""

    status, code, title = 503, "no_registry", "The registry cannot be reached"


class NotNotedError(ApiError):
    """It was done, but the registry's database could not be used to write it down."""

    status, code, title = 503, "not_noted", "It is done, but not written down"


class NotStoredError(ApiError):
    """The disk takes nothing: it is full or read-only."""

    status, code, title = 507, "not_stored", "It cannot be kept"


class UnavailableError(ApiError):
    """The rig is not ready."""

    status, code, title = 503, "unavailable", "The rig is not ready"


class StaleError(ApiError):
    """The command was too old when the rig got it: the server's clock and the rig's differ."""

    status, code, title = 503, "stale", "The command came too late"


# A refusal that is not the caller's to mend (`stale`: the api process stamps the command)
# is a 503, so that a retry is right.
REFUSALS: Final[dict[str, type[ApiError]]] = {
    "bad_request": InvalidError,
    "too_large": TooLargeError,
    "stale": StaleError,
    "not_owner": NotOwnerError,
    "not_armed": RigNotArmedError,
    "tripped": TrippedError,
    "conflict": ConflictError,
    "not_feasible": NotFeasibleError,
    "unavailable": UnavailableError,
}
if set(REFUSALS) != set(get_args(RefusalCode)):
    raise AssertionError("every refusal of a rig needs an error of the API")

EVERYWHERE: Final = (
    HttpError,
    CrossOriginError,
    WrongHostError,
    TooOftenError,
    BusyError,
)
"""What a request may be answered with before its path is looked at."""
OF_BODIES: Final = (SlowBodyError, TooLargeError)


def places(errors: list[ErrorDetails] | Any, prefix: tuple[str, ...] = ()) -> list[Place]:
    """Return pydantic's errors, without the values that were sent; at most 100."""
    return [
        Place(where=[*prefix, *error["loc"]], what=complaint(error))
        for error in list(errors)[:100]
    ]


def documented(*kinds: type[ApiError]) -> dict[int | str, dict[str, Any]]:
    """Return the entries of the OpenAPI page for the errors of a path."""
    responses: dict[int | str, dict[str, Any]] = {}
    every: set[type[ApiError]] = {*kinds, InternalError}
    for kind in sorted(every, key=lambda kind: (kind.status, kind.code)):
        said = responses.get(kind.status, {}).get("description")
        text = f"`{kind.code}`: {kind.title}"
        responses[kind.status] = {
            "description": f"{said}; {text}" if said else text,
            "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
        }
    return responses
