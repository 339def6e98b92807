"""Why a viewer is refused something."""

from typing import Final

from frictus_service.errors import ServiceError

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
    """

    def __init__(self, what: str, code: str, message: str, close: int | None) -> None:
        super().__init__(message)
        self.what = what
        self.code = code
        self.close = close
