"""Errors of identification."""

from frictus_service.study.errors import StudyError


class NothingToIdentifyError(StudyError):
    """No trial of the study can be used; the text says why."""


class NoModelError(StudyError):
    """The identification gives no such model; the text says what it lacks."""
