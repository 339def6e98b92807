"""The tasks of the device: inputs as the clock's master, the output slaved, the watchdog line.

A digital line that is high only while it is fed; an amplifier's interlock hangs on it.

The device itself pulls it low: neither the program nor the computer has to be alive for that.
Its watchdog covers digital lines only, not the analogue output.

The two tasks of the device: inputs as the clock's master, the output slaved to them.

What driver and link raise leaves it typed.
"""

from typing import Any, Final

import nidaqmx
import numpy as np
from nidaqmx.constants import (
    AcquisitionType,
    Level,
    OutputDataTransferCondition,
    RegenerationMode,
    TerminalConfiguration,
)
from nidaqmx.errors import DaqReadError, DaqWriteError
from nidaqmx.stream_readers import AnalogMultiChannelReader
from nidaqmx.stream_writers import AnalogSingleChannelWriter, DigitalSingleChannelWriter
from nidaqmx.system.device import Device
from nidaqmx.system.watchdog import DOExpirationState, WatchdogTask

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError, HardwareError, LinkLostError
from frictus_hardware.nidaq.config import Inputs, InterlockLine, NiConfig, Terminals
from frictus_hardware.nidaq.devices import is_on_usb
from frictus_hardware.nidaq.driver import TRANSIENT, Driver


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


INPUT_BUFFER_S = 2.0
"""A loop that falls further behind than this has lost the stream."""

AT_ONCE: Final = OutputDataTransferCondition.ON_BOARD_MEMORY_LESS_THAN_FULL

_TERMINALS: dict[Terminals, TerminalConfiguration] = {
    "default": TerminalConfiguration.DEFAULT,
    "rse": TerminalConfiguration.RSE,
    "nrse": TerminalConfiguration.NRSE,
    "differential": TerminalConfiguration.DIFF,
    "pseudo_differential": TerminalConfiguration.PSEUDO_DIFF,
}


class DeviceSession:
    """The tasks of one opening of a device; for one thread.

    Parameters
    ----------
    config : NiConfig
        The device and what is wired to it.

    Attributes
    ----------
    device_lead_samples : int
        The part of the lead in force that is in the device.
    """

    def __init__(self, config: NiConfig) -> None:
        self._config = config
        self._driver = Driver(config)
        self._tasks: list[Any] = []
        self._inputs: Any = None
        self._output: Any = None
        self._watchdog: Watchdog | None = None
        self._reader: Any = None
        self._writer: Any = None
        self.device_lead_samples = config.device_lead_samples

    @property
    def _wait_s(self) -> float:
        """How long a call waits for samples: as long as there are any to play."""
        config = self._config
        return (config.block_samples + self.device_lead_samples) / config.sample_rate_hz

    def set_up(self, zeros: int) -> None:
        """Reset the device, set both tasks up, and prefill the output with zeros.

        Parameters
        ----------
        zeros : int
            How many; what is written before the start.

        Raises
        ------
        HardwareError
            Typed by the fault table; what was set up is for `close` to release.
        """
        self.reset()  # frees what a client that died has left behind, and puts out 0 V
        self._require_bus()
        self._set_up_inputs()
        self._set_up_output()
        self._set_up_interlock()
        if (written := self.write(np.zeros(zeros))) < zeros:
            raise ConfigError(
                f"lead_ms = {self._config.lead_ms:g}: the output took {written} of {zeros} "
                "samples in advance; lower the lead"
            )

    def start(self) -> None:
        """Start the clock."""
        with self._driver.typed(f"starting the tasks of device = {self._config.device!r}"):
            self._output.start()  # waits for the clock, which the inputs start
            self._inputs.start()
            if self._watchdog is not None:
                self._watchdog.start()

    @property
    def conversion_rate_hz(self) -> float:
        """Rate at which one channel after the other is converted within a sample."""
        with self._driver.typed("reading the conversion rate"):
            return float(self._inputs.timing.ai_conv_rate)

    def acquired(self) -> int:
        """Return how many samples the inputs have taken since the start."""
        with self._driver.typed("reading the sample count"):
            return int(self._inputs.in_stream.total_samp_per_chan_acquired)

    def read(self, n_samples: int) -> FloatArray:
        """Return the next input samples; fewer if they did not come in time.

        Parameters
        ----------
        n_samples : int
            At most a block.

        Returns
        -------
        ndarray, shape (n_channels, n_samples)
            Volts.
        """
        if self._watchdog is not None:
            with self._driver.typed("feeding the watchdog of the interlock"):
                self._watchdog.feed()
        volts = np.empty((len(self._config.channels), n_samples))
        with self._driver.typed("reading the inputs"):
            try:
                self._reader.read_many_sample(volts, n_samples, timeout=self._wait_s)
            except DaqReadError as error:
                if error.error_code not in TRANSIENT:
                    raise
                return volts[:, : error.samps_per_chan_read]
        return volts

    def write(self, output_v: FloatArray) -> int:
        """Queue output; return how many samples found room in time.

        Parameters
        ----------
        output_v : ndarray, shape (n_samples,)
            Volts at the output's connector.
        """
        with self._driver.typed(f"writing the output, output = {self._config.output!r}"):
            try:
                written: int = self._writer.write_many_sample(output_v, timeout=self._wait_s)
            except DaqWriteError as error:
                if error.error_code not in TRANSIENT:
                    raise
                return int(error.samps_per_chan_written)
        return written

    def stop(self) -> None:
        """Stop both tasks; the output holds what it played last."""
        with self._driver.typed("stopping the tasks"):
            self._output.stop()
            self._inputs.stop()

    def make_safe(self) -> HardwareError | None:
        """Bring the output to 0 V by whatever still works; return why it failed, or None."""
        try:
            self._release()
            self._write_zero()
            return None
        except LinkLostError as error:
            return error  # what else could be tried takes the same link
        except HardwareError:
            pass  # a reset needs none of what failed
        try:
            self.reset()
        except HardwareError as error:
            return error
        return None

    def reset(self) -> None:
        """Reset the device: every task on it is aborted, and its outputs go to 0 V."""
        with self._driver.typed(f"resetting device = {self._config.device!r}"):
            Device(self._config.device, grpc_options=self._driver.options).reset_device()

    def close(self) -> None:
        """Release the tasks and the link; what becomes of the output is decided before."""
        try:
            self._release()
        except LinkLostError:
            pass  # nothing is left to release
        finally:
            self._driver.close()

    def _require_bus(self) -> None:
        """Refuse a lead that the device's bus cannot hold."""
        wrong = self._config.too_short_for_usb
        if wrong is None:
            return
        device = Device(self._config.device, grpc_options=self._driver.options)
        with self._driver.typed(f"asking for the bus of device = {self._config.device!r}"):
            if is_on_usb(device):
                raise ConfigError(wrong)

    def _set_up_inputs(self) -> None:
        config = self._config
        self._inputs = self._new_task()
        for name, inputs in config.groups:
            self._add_inputs(name, inputs)
        with self._driver.typed(
            f"setting the clock, sample_rate_hz = {config.sample_rate_hz:g} for "
            f"{len(config.channels)} channels"
        ):
            buffer = round(INPUT_BUFFER_S * config.sample_rate_hz)
            self._inputs.timing.cfg_samp_clk_timing(
                config.sample_rate_hz,
                sample_mode=AcquisitionType.CONTINUOUS,
                samps_per_chan=buffer,
            )
            self._inputs.in_stream.input_buf_size = buffer
            self._reader = AnalogMultiChannelReader(self._inputs.in_stream)
            self._reader.verify_array_shape = False  # else one more call per read

    def _add_inputs(self, name: str, inputs: Inputs) -> None:
        line = (
            f"{name}: channels = {list(inputs.channels)} on device = {self._config.device!r}, "
            f"range_v = {inputs.range_v:g}, terminals = {inputs.terminals!r}"
        )
        with self._driver.typed(line):
            self._inputs.ai_channels.add_ai_voltage_chan(
                ", ".join(f"{self._config.device}/{channel}" for channel in inputs.channels),
                terminal_config=_TERMINALS[inputs.terminals],
                min_val=-inputs.range_v,
                max_val=inputs.range_v,
            )

    def _set_up_output(self) -> None:
        config = self._config
        self._output, channel = self._new_output_task()
        with self._driver.typed(
            f"setting the output's clock, output = {config.output!r}, "
            f"sample_rate_hz = {config.sample_rate_hz:g}"
        ):
            buffer = config.buffer_samples
            self._output.timing.cfg_samp_clk_timing(
                config.sample_rate_hz,
                source=f"/{config.device}/ai/SampleClock",
                sample_mode=AcquisitionType.CONTINUOUS,
                samps_per_chan=buffer,
            )
            self._output.out_stream.regen_mode = RegenerationMode.DONT_ALLOW_REGENERATION
            self._output.out_stream.output_buf_size = buffer
            self._writer = AnalogSingleChannelWriter(self._output.out_stream, auto_start=False)
            self._writer.verify_array_shape = False
        self._send_at_once(channel)

    def _send_at_once(self, channel: Any) -> None:
        """Have what is written moved to the device as soon as there is room.

        Its memory is much larger than a lead: a device that waits until it is empty would run
        dry. On a bus that knows no such condition the driver moves it in its own way.
        """
        try:
            with self._driver.typed("setting when output is moved to the device"):
                channel.ao_data_xfer_req_cond = AT_ONCE
        except ConfigError:
            pass  # the device does not offer the setting

    def _set_up_interlock(self) -> None:
        interlock = self._config.interlock
        if interlock is None:
            return
        with self._driver.typed(
            f"interlock: line = {interlock.line!r} on device = {self._config.device!r}"
        ):
            self._watchdog = Watchdog(self._config.device, interlock, self._driver.options)
        self._tasks.append(self._watchdog)  # the last: whatever ends, the interlock opens first

    def _new_output_task(self) -> tuple[Any, Any]:
        """Return a task and its one channel."""
        config = self._config
        task = self._new_task()
        with self._driver.typed(
            f"output = {config.output!r} on device = {config.device!r}, screen_peak_v = "
            f"{config.screen_peak_v:g} with amplifier_gain = {config.amplifier_gain:g}"
        ):
            channel = task.ao_channels.add_ao_voltage_chan(
                f"{config.device}/{config.output}",
                min_val=-config.peak_output_v,
                max_val=config.peak_output_v,
            )
        return task, channel

    def _new_task(self) -> Any:
        with self._driver.typed("creating a task"):
            task = nidaqmx.Task(grpc_options=self._driver.options)
        self._tasks.append(task)
        return task

    def _write_zero(self) -> None:
        task, _ = self._new_output_task()
        with self._driver.typed("writing 0 V"):
            writer = AnalogSingleChannelWriter(task.out_stream, auto_start=True)
            writer.write_one_sample(0.0, timeout=self._wait_s)
        self._release()

    def _release(self) -> None:
        while self._tasks:
            task = self._tasks.pop()
            try:
                with self._driver.typed("releasing a task"):
                    task.close()
            except LinkLostError:
                self._tasks.clear()  # the server drops them with the session, or a reset does
                raise
            except HardwareError:
                pass  # clearing a broken task repeats its fault, which is known
