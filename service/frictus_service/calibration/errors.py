"""Errors of calibration; all are also the natural builtin."""

from frictus_service.errors import ServiceError


class ExcitationDesignError(ServiceError, ValueError):
    """An excitation cannot be built as asked; the text says which limit it meets."""


class PriorError(ServiceError, ValueError):
    """Earlier models say nothing that can be learned; the text names the model."""


class EstimateError(ServiceError, ValueError):
    """The trials do not determine the law; the text says what to measure."""


class ContradictionError(EstimateError):
    """No law fits the trials, or none that the prior admits."""


class CalibrationError(ServiceError, RuntimeError):
    """A calibration could not go on; the text says why, and what was kept."""


class CancelledError(CalibrationError):
    """Somebody ended the calibration; the finished trials are kept."""


class CaptureError(CalibrationError):
    """A trial came in too incomplete to be used; the text says which stream."""


class FolderError(CalibrationError, ValueError):
    """The folder holds another calibration, or something that is none."""
