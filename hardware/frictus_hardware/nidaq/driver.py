"""The way to NI's driver, and from what it reports to the rows of the fault table.

The way to NI's driver: of this machine, or behind NI's gRPC device server.

Imports nidaqmx, and with it gRPC: only what talks to a device may import this.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import grpc
import nidaqmx
from nidaqmx.errors import DaqError, Error, RpcError

from frictus_hardware.errors import (
    ConfigError,
    DeviceLostError,
    DriverMissingError,
    HardwareError,
    LinkLostError,
    StreamLostError,
    TransientError,
    UnderrunError,
)
from frictus_hardware.nidaq.config import NiConfig, ServerTls

RESET_S = 10.0
"""What the reset of a device may take beyond the deadline of other calls."""


class Driver:
    """A way to the driver; closed by who made it.

    Parameters
    ----------
    config : NiConfig

    Attributes
    ----------
    options : nidaqmx.GrpcSessionOptions or None
        What nidaqmx takes; None for the driver of this machine.

    Raises
    ------
    ConfigError
        If a file of certificates cannot be read.
    """

    def __init__(self, config: NiConfig) -> None:
        self.options: nidaqmx.GrpcSessionOptions | None = None
        self._address = config.address
        self._link: Any = None
        if config.address is not None:
            self._link = _channel(config.address, config.tls)
            guarded = grpc.intercept_channel(self._link, Deadline(config.deadline_s))
            self.options = nidaqmx.GrpcSessionOptions(guarded, "")

    def close(self) -> None:
        """Close the link, where there is one."""
        if self._link is not None:
            self._link.close()

    @contextmanager
    def typed(self, line: str) -> Iterator[None]:
        """Raise what driver and link raise as typed faults that name a configuration line."""
        try:
            yield
        except DaqError as error:
            raise fault_of_code(error.error_code, line, str(error)) from error
        except RpcError as error:
            status = getattr(error.rpc_code, "name", str(error.rpc_code))
            where = f"{line}, address = {self._address!r}"
            raise fault_of_status(status, where, _detail(error)) from error
        except Error as error:  # the driver is not installed, or too old for what is asked
            raise DriverMissingError(
                f"{line}: {error} Install NI-DAQmx, or give the address of NI's gRPC device "
                "server"
            ) from error


class Deadline(grpc.UnaryUnaryClientInterceptor):  # type: ignore[misc]
    """Puts a time limit on every remote call; nidaqmx sets none and would wait for ever.

    Parameters
    ----------
    deadline_s : float
        Beyond what the call itself is told to wait for samples.
    """

    def __init__(self, deadline_s: float) -> None:
        self._deadline_s = deadline_s

    def intercept_unary_unary(self, proceed: Any, details: Any, request: Any) -> Any:
        """Proceed with the time limit."""
        waits_s = max(getattr(request, "timeout", 0.0), 0.0)
        if details.method.endswith("/ResetDevice"):
            waits_s = RESET_S
        return proceed(details._replace(timeout=self._deadline_s + waits_s), request)


def _channel(address: str, tls: ServerTls | None) -> Any:
    """Return a link to a server; it is made when it is used first."""
    if tls is None:
        return grpc.insecure_channel(address)
    ours: tuple[bytes | None, bytes | None] = (None, None)
    if tls.certificate is not None:
        ours = (_read(tls.certificate.with_suffix(".key")), _read(tls.certificate))
    credentials = grpc.ssl_channel_credentials(_read(tls.authority), *ours)
    return grpc.secure_channel(address, credentials)


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise ConfigError(f"tls: {file} cannot be read: {error}") from error


def _detail(error: RpcError) -> str:
    """Return what gRPC itself said; nidaqmx replaces it, and with it why there is no link."""
    told = error.__context__
    return str(told.details()) if isinstance(told, grpc.Call) else str(error.description)


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
UNDERRUN: Mapping[int, str] = {
    -200290: "the output ran dry",
    -200018: "the output's converter ran dry",
    -200621: "the device's output memory ran dry",
}
STREAM_LOST: Mapping[int, str] = {
    -200279: "samples were overwritten before they were read",
    -200361: "the device's input memory overflowed",
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
    (UnderrunError, UNDERRUN),
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
