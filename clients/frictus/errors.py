"""Every error the client raises on purpose; each is also the natural builtin."""

import reprlib
from typing import Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails


class FrictusError(Exception):
    """Base of every error of this package."""


class FrameError(FrictusError, ValueError):
    """Bytes on the wire are not a frame of the protocol; the text says which field and why."""


class TextureError(FrictusError, ValueError):
    """A texture or scene cannot be represented; the text says what is accepted."""


class RefusedError(FrictusError, RuntimeError):
    """The rig refused a command.

    Parameters
    ----------
    code : str
        Stable word for programs: one of `frictus.messages.RefusalCode`; also an attribute.
    message : str
        For people.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


class LeaseLostError(FrictusError, RuntimeError):
    """The rig no longer obeys this client: its lease ended before it was given back.

    Parameters
    ----------
    reason : str
        Why, for people; it names who and when where the rig said so.
    by : str or None
        The client that stopped the rig; None for a fault, a late renewal or a lost link. Also
        an attribute.
    utc_ns : int or None
        When, by the rig's clock; None where the rig did not say. Also an attribute.
    """

    def __init__(self, reason: str, by: str | None = None, utc_ns: int | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.by = by
        self.utc_ns = utc_ns


class NoRigError(FrictusError, LookupError):
    """No rig answers under the given name."""


class LinkError(FrictusError, ConnectionError):
    """No router can be reached, or the link to it is gone."""


class OutcomeUnknownError(LinkError):
    """A request was sent and not answered: the rig may have done it, or may still do it.

    Read the state that it was to change before it is sent again.
    """


class OutdatedStateError(LinkError):
    """The rig has confirmed a change but not published it: what it said last is out of date."""


class CertificateError(LinkError):
    """A certificate or key cannot be used; the text says which file, why, and what to do."""


class SilenceError(FrictusError, TimeoutError):
    """Nothing arrived within the time given."""


class ArgumentError(FrictusError, ValueError):
    """An argument of a call is out of range; the text says which and what is accepted."""


class NotLoggedError(FrictusError, OSError):
    """A trial was not logged: the file was taken away, or the disk is full."""


class UnreadableFileError(FrictusError, OSError):
    """A file is none that can be read: a pipe, a device, or far too long."""

    def __str__(self) -> str:
        """Return file and reason without the number."""
        return f"{self.filename}: {self.strerror}"


def printable(text: str) -> str:
    """Return a text as one can show it: control and formatting characters escaped.

    Parameters
    ----------
    text : str
        Of a file or a sender; a terminal would obey what it holds. Its lines stay.
    """
    return "".join(
        each if each.isprintable() or each == "\n" else ascii(each)[1:-1] for each in text
    )


_SHORT = reprlib.Repr()
_SHORT.maxlevel = 2
"""What a sender wrote may be megabytes: it is shortened before it is written out."""

_ALL_AROUND: Final = ("missing", "union_tag_not_found", "union_tag_invalid")
"""Complaints of which the input is all that surrounds what is wrong."""


def complaint(detail: ErrorDetails) -> str:
    """Say what one value got wrong, without the value, but for the kind of a union.

    Parameters
    ----------
    detail : ErrorDetails
        One of pydantic's complaints.
    """
    about = detail.get("ctx", {})
    if detail["type"] == "union_tag_invalid":
        tag = _SHORT.repr(about["tag"])
        return f"{about['discriminator']} is {tag}; accepted: {about['expected_tags']}"
    if detail["type"] == "union_tag_not_found":
        return f"the key {about['discriminator']} is missing"
    return detail["msg"].removeprefix("Value error, ")


def explain(error: ValidationError) -> str:
    """Say in one line what a message, texture or model got wrong, and where.

    Parameters
    ----------
    error : pydantic.ValidationError
        As pydantic raised it; at most three of its complaints are told.
    """
    complaints = []
    for detail in error.errors(include_url=False)[:3]:
        where = printable(".".join(str(part) for part in detail["loc"]))
        message = printable(complaint(detail))
        if detail["type"] not in _ALL_AROUND:
            message += f" (got {_SHORT.repr(detail['input'])})"
        complaints.append(f"{where or 'document'}: {message}")
    more = error.error_count() - len(complaints)
    return "; ".join(complaints) + (f"; and {more} more" if more else "")
