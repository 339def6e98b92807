"""A digital line that is high only while it is fed; an amplifier's interlock hangs on it.

The device itself pulls it low: neither the program nor the computer has to be alive for that.
Its watchdog covers digital lines only, not the analogue output.
"""

from typing import Any

import nidaqmx
from nidaqmx.constants import Level
from nidaqmx.stream_writers import DigitalSingleChannelWriter
from nidaqmx.system.watchdog import DOExpirationState, WatchdogTask

from frictus_hardware.nidaq.config import InterlockLine


class Watchdog:
    """The line and its timer; raises what nidaqmx raises.

    Parameters
    ----------
    device : str
        Its name in the driver.
    interlock : InterlockLine
        Digital line and its polarity.
    options : nidaqmx.GrpcSessionOptions or None
        Of a device behind NI's server; None: local.
    """

    def __init__(
        self, device: str, interlock: InterlockLine, options: nidaqmx.GrpcSessionOptions | None
    ) -> None:
        line = f"{device}/{interlock.line}"
        self._tasks: list[Any] = []
        try:
            self._timer = self._kept(
                WatchdogTask(device, timeout=1e-3 * interlock.timeout_ms, grpc_options=options)
            )
            self._timer.cfg_watchdog_do_expir_states([DOExpirationState(line, Level.LOW)])
            output = self._kept(nidaqmx.Task(grpc_options=options))
            output.do_channels.add_do_chan(line)
            self._writer = DigitalSingleChannelWriter(output.out_stream, auto_start=True)
            self._writer.verify_array_shape = False
        except BaseException:
            self._clear()
            raise

    def start(self) -> None:
        """Let the line be high, from now on for as long as it is fed."""
        self._timer.start()
        self._writer.write_one_sample_one_line(True)

    def feed(self) -> None:
        """Keep the line high for another timeout."""
        self._timer.reset_timer()

    def close(self) -> None:
        """Pull the line low and let go of it."""
        try:
            self._writer.write_one_sample_one_line(False)
        finally:
            self._clear()

    def _kept(self, task: Any) -> Any:
        self._tasks.append(task)
        return task

    def _clear(self) -> None:
        while self._tasks:
            self._tasks.pop().close()
