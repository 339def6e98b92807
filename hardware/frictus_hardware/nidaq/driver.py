"""The way to NI's driver: of this machine, or behind NI's gRPC device server.

Imports nidaqmx, and with it gRPC: only what talks to a device may import this.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import grpc
import nidaqmx
from nidaqmx.errors import DaqError, Error, RpcError

from frictus_hardware.errors import ConfigError, DriverMissingError
from frictus_hardware.nidaq.config import NiConfig, ServerTls
from frictus_hardware.nidaq.faults import fault_of_code, fault_of_status

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
