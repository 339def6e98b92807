"""What pages send is read here, and why one is refused something."""

from typing import Annotated, Final

from pydantic import Field, TypeAdapter, ValidationError

from frictus.messages import Message
from frictus.websocket.messages import MAX_BYTES, Asked
from frictus_service.errors import ServiceError

_ASKED: Final[TypeAdapter[Asked]] = TypeAdapter(Annotated[Asked, Field(discriminator="op")])


def read(text: str) -> Asked:
    """Read what a page sent.

    Parameters
    ----------
    text : str
        A JSON object, at most 64 kB.

    Raises
    ------
    RefusedViewerError
        If it is not one of the messages above.
    """
    if len(text) > MAX_BYTES:
        raise RefusedViewerError(
            "message", "too_large", f"a message has at most {MAX_BYTES} bytes", BAD_DATA
        )
    try:
        return _ASKED.validate_json(text, strict=True, extra="forbid")
    except ValidationError as error:
        # Never what was given: it may hold a token.
        faults = error.errors(include_url=False, include_input=False, include_context=False)
        complaints = "; ".join(
            f"{'.'.join(str(part) for part in fault['loc']) or 'message'}: {fault['msg']}"
            for fault in faults[:3]
        )
        raise RefusedViewerError("message", "malformed", complaints[:1_000], BAD_DATA) from None


def told(op: str, rig: str, message: Message) -> str:
    """Return what passes on a message of a rig: under `op`, in a field of that name.

    Parameters
    ----------
    op : str
        Such as ``status``.
    rig : str
        Name of the rig.
    message : Message
        As the rig published it.
    """
    return f'{{"op":"{op}","rig":"{rig}","{op}":{message.to_json().decode()}}}'


BAD_DATA: Final = 1003
NOT_ALLOWED: Final = 1008
TRY_LATER: Final = 1013


class RefusedViewerError(ServiceError, PermissionError):
    """What a viewer sent is malformed or not allowed.

    Parameters
    ----------
    what : str
        What it was about, such as ``hello`` or ``point``.
    code : str
        Stable word for programs.
    message : str
        For people: what was wrong, what is accepted, what to do.
    close : int or None
        Code that the connection is closed with; None: it stays.

    Attributes
    ----------
    request : int or None
        `id` of the request that is refused; None where it has none, or could not be read.
    """

    request: int | None = None

    def __init__(self, what: str, code: str, message: str, close: int | None) -> None:
        super().__init__(message)
        self.what = what
        self.code = code
        self.close = close
