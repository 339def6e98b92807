"""From what the driver or the link reports to the rows of the fault table."""

from collections.abc import Mapping

from frictus_hardware.errors import (
    ConfigError,
    DeviceLostError,
    HardwareError,
    LinkLostError,
    StreamLostError,
    TransientError,
)


class UnlistedFaultError(DeviceLostError):
    """A fault that no row of the table knows; treated as a lost device."""


CONFIG: Mapping[int, str] = {
    -200220: "there is no device of this name",
    -200170: "the device has no such channel",
    -200430: "the channel is of another kind",
    -200489: "the channel is used twice",
    -200077: "the device does not offer this value",
    -200081: "the sample rate is too high for so many channels",
    -200332: "the sample rate is too high",
    -200452: "the device does not offer this setting",
    -200561: "the output asked for is beyond its range",
    -50103: "another program uses the device",
    -200022: "another program uses the device",
}
TRANSIENT: Mapping[int, str] = {
    -200284: "the samples did not come in time",
    -200292: "the output buffer was full",
}
STREAM_LOST: Mapping[int, str] = {
    -200290: "the output ran dry",
    -200279: "samples were overwritten before they were read",
    -200361: "the device's input memory overflowed",
    -200018: "the output's converter ran dry",
    -200621: "the device's output memory ran dry",
}
DEVICE_LOST: Mapping[int, str] = {
    -88709: "the device was removed or reset",
    -88710: "the device was removed or reset",
    -50405: "the transfer from the device was aborted",
    -200045: "the device was removed",
    -200088: "the task is gone: the device or its server was restarted",
}
_TABLE: tuple[tuple[type[HardwareError], Mapping[int, str]], ...] = (
    (ConfigError, CONFIG),
    (TransientError, TRANSIENT),
    (StreamLostError, STREAM_LOST),
    (DeviceLostError, DEVICE_LOST),
)

LINK_LOST: Mapping[str, str] = {
    "UNAVAILABLE": "the server cannot be reached",
    "DEADLINE_EXCEEDED": "the server does not answer",
}
HANDSHAKE = "handshake"
"""What gRPC says of a certificate that is not accepted."""
REFUSED: Mapping[str, str] = {
    "UNAUTHENTICATED": "the server refuses who we are",
    "PERMISSION_DENIED": "the server does not allow it",
    "UNIMPLEMENTED": "the server is too old, or none of NI-DAQmx",
    "INVALID_ARGUMENT": "the server does not understand the request",
}


def fault_of_code(code: int, line: str, detail: str) -> HardwareError:
    """Return the typed fault of a DAQmx error code.

    Parameters
    ----------
    code : int
        Negative DAQmx status.
    line : str
        What was being done, with the line of the configuration that it follows.
    detail : str
        The driver's own text.
    """
    for kind, meanings in _TABLE:
        if code in meanings:
            return kind(f"{line}: {meanings[code]} (DAQmx {code}). {_first_line(detail)}")
    return UnlistedFaultError(
        f"{line}: DAQmx {code}, which is not in the fault table and is treated as a lost "
        f"device. {_first_line(detail)}"
    )


def fault_of_status(status: str, line: str, detail: str) -> HardwareError:
    """Return the typed fault of a gRPC status that carries no DAQmx error.

    Parameters
    ----------
    status : str
        Name of the status, such as UNAVAILABLE.
    line, detail : str
        As for `fault_of_code`.
    """
    if status == "UNAVAILABLE" and HANDSHAKE in detail.lower():
        return ConfigError(
            f"{line}: no encrypted link: either side refuses the other's certificate "
            f"({status}). Compare authority, names, dates and clocks. {_first_line(detail)}"
        )
    if status in LINK_LOST:
        return LinkLostError(f"{line}: {LINK_LOST[status]} ({status}). {_first_line(detail)}")
    if status in REFUSED:
        return ConfigError(f"{line}: {REFUSED[status]} ({status}). {_first_line(detail)}")
    return UnlistedFaultError(
        f"{line}: gRPC status {status}, which is not in the fault table and is treated as a "
        f"lost device. {_first_line(detail)}"
    )


def _first_line(detail: str) -> str:
    """Return the driver's text without the property tables that follow it."""
    return detail.strip().partition("\n")[0]
