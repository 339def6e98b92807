# ruff: noqa: N802 - the calls have the names of NI's service
"""A fake of NI's gRPC device server: as much of it as the backend uses, and faults on demand.

Errors travel as NI's server sends them: status UNKNOWN with the DAQmx code in the trailing
metadata; only a read timeout answers with its code in the response.
"""

import threading
import uuid
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import grpc
import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as messages
from nidaqmx._stubs import nidaqmx_pb2_grpc as services
from session_pb2 import Session
from tests.hardware.nidaq.fake_device import (
    MAX_CONVERSIONS_HZ,
    MAX_OUTPUT_HZ,
    NO_CHANNEL,
    NOT_YET,
    RANGE_V,
    TASK_GONE,
    FakeDaqError,
    FakeDevice,
    FakeTask,
    Watched,
)

HARMLESS = (-200284, -200292)
"""What leaves the tasks running."""

_DEVICE_NAMES, _PRODUCT, _INPUTS, _OUTPUTS = 0x193B, 0x631, 0x231E, 0x231F
_INPUT_RATE, _OUTPUT_RATE, _INPUT_RANGES, _OUTPUT_RANGES = 0x298D, 0x2997, 0x2990, 0x299B
_SIMULTANEOUS, _TERMINALS, _BUS = 0x298F, 0x2342, 0x2326
_TRANSFER_CONDITION = 0x183C
_REGENERATION, _REGENERATES = 0x1453, 10097
_ACQUIRED, _CONVERSION_RATE, _TASK_NAME = 0x192A, 0x1848, 0x1276
_GROUP_BY_CHANNEL = 0
_LOW, _RESET_TIMER = 10214, 0
AT_ONE_TIME_HZ = 1e12


@dataclass
class Fault:
    """What goes wrong.

    Attributes
    ----------
    failure : int, grpc.StatusCode or "hang"
        A DAQmx code, what the link reports, or no answer at all.
    rpc : str
        The call that fails, such as ReadAnalogF64; empty for any.
    at_sample : int
        From this tick of the device on.
    times : int
        So often.
    partial : int
        Samples that a failing read or write still gets done.
    """

    failure: int | grpc.StatusCode | str
    rpc: str = ""
    at_sample: int = 0
    times: int = 1
    partial: int = 0


Handler = Callable[["FakeServicer", Any, Any], Any]


def served(handler: Handler) -> Handler:
    """One call at a time, planned faults first."""
    name = handler.__name__

    def guarded(self: "FakeServicer", request: Any, context: Any) -> Any:
        self.calls[name] += 1
        fault = self.due(name)
        if fault is not None and fault.failure == "hang":
            gone = threading.Event()
            if context.add_callback(gone.set):
                gone.wait()
            return None
        if fault is not None and isinstance(fault.failure, grpc.StatusCode):
            context.abort(fault.failure, "injected")
        with self.lock:
            try:
                if fault is not None:
                    return self.fail(fault, request)
                return handler(self, request, context)
            except FakeDaqError as error:
                failed = error
        metadata = [("ni-error", str(failed.code))]
        if failed.read is not None:
            metadata.append(("ni-samps-per-chan-read", str(failed.read)))
        if failed.written is not None:
            metadata.append(("ni-samps-per-chan-written", str(failed.written)))
        context.set_trailing_metadata(tuple(metadata))
        return context.abort(grpc.StatusCode.UNKNOWN, str(failed))

    guarded.__name__ = name
    return guarded


class FakeServicer(services.NiDAQmxServicer):  # type: ignore[misc]
    def __init__(self, device: FakeDevice) -> None:
        self.device = device
        self.lock = threading.Lock()
        self.calls: Counter[str] = Counter()
        self.faults: list[Fault] = []
        self.struck: list[Fault] = []

    def due(self, name: str) -> Fault | None:
        for fault in self.faults:
            if fault.rpc in {"", name} and self.device.now >= fault.at_sample:
                fault.times -= 1
                if fault.times == 0:
                    self.faults.remove(fault)
                self.struck.append(fault)
                return fault
        return None

    def fail(self, fault: Fault, request: Any) -> Any:
        code = fault.failure
        assert isinstance(code, int)
        if code not in HARMLESS:
            self.device.fail(code)
        kind = type(request).__name__
        if kind == "ReadAnalogF64Request":
            if code != NOT_YET:
                raise FakeDaqError(code, read=0)
            return self._answer_read(request, fault.partial)
        if kind == "WriteAnalogF64Request":
            task = self._task(request)
            values = np.array(request.write_array[: fault.partial])
            raise FakeDaqError(code, written=self.device.write(task, values, 0.0))
        raise FakeDaqError(code)

    def _task(self, request: Any) -> FakeTask:
        return self.device.task(request.task.name)

    @served
    def CreateTask(self, request: Any, context: Any) -> Any:
        name = request.session_name or uuid.uuid4().hex
        self.device.tasks[name] = FakeTask(name)
        return messages.CreateTaskResponse(
            task=Session(name=name), new_session_initialized=True
        )

    @served
    def ClearTask(self, request: Any, context: Any) -> Any:
        self.device.watched.pop(request.task.name, None)
        if self.device.tasks.pop(request.task.name, None) is None:
            raise FakeDaqError(TASK_GONE)
        return messages.ClearTaskResponse()

    @served
    def CreateWatchdogTimerTaskEx(self, request: Any, context: Any) -> Any:
        self.device.require(request.device_name)
        name = request.session_name or uuid.uuid4().hex
        self.device.tasks[name] = FakeTask(name, kind="watchdog")
        self.device.watched[name] = Watched(request.timeout)
        return messages.CreateWatchdogTimerTaskExResponse(
            task=Session(name=name), new_session_initialized=True
        )

    @served
    def CfgWatchdogDOExpirStates(self, request: Any, context: Any) -> Any:
        assert list(request.expir_state_array) == [_LOW]
        self.device.watched[request.task.name].lines.append(request.channel_names)
        return messages.CfgWatchdogDOExpirStatesResponse()

    @served
    def ControlWatchdogTask(self, request: Any, context: Any) -> Any:
        assert request.action_raw == _RESET_TIMER
        self.device.feed(self._task(request).name)
        return messages.ControlWatchdogTaskResponse()

    @served
    def CreateDOChan(self, request: Any, context: Any) -> Any:
        device, _, line = request.lines.partition("/")
        self.device.require(device)
        if not line.startswith("port0/"):
            raise FakeDaqError(NO_CHANNEL)
        task = self._task(request)
        task.kind = "do"
        task.channels.append(request.lines)
        return messages.CreateDOChanResponse()

    @served
    def WriteDigitalLines(self, request: Any, context: Any) -> Any:
        (line,) = self._task(request).channels
        self.device.lines[line] = bool(request.write_array[0])
        return messages.WriteDigitalLinesResponse(samps_per_chan_written=1)

    @served
    def StartTask(self, request: Any, context: Any) -> Any:
        watched = self.device.watched.get(request.task.name)
        if watched is not None:
            watched.running, watched.fed_at = True, self.device.now
            return messages.StartTaskResponse()
        self.device.start(self._task(request))
        return messages.StartTaskResponse()

    @served
    def StopTask(self, request: Any, context: Any) -> Any:
        self.device.stop(self._task(request))
        return messages.StopTaskResponse()

    @served
    def CreateAIVoltageChan(self, request: Any, context: Any) -> Any:
        self.device.add_channels(
            self._task(request), "ai", request.physical_channel, request.max_val
        )
        return messages.CreateAIVoltageChanResponse()

    @served
    def CreateAOVoltageChan(self, request: Any, context: Any) -> Any:
        self.device.add_channels(
            self._task(request), "ao", request.physical_channel, request.max_val
        )
        return messages.CreateAOVoltageChanResponse()

    @served
    def CfgSampClkTiming(self, request: Any, context: Any) -> Any:
        task = self._task(request)
        self.device.set_clock(task, request.rate, request.source, request.samps_per_chan)
        return messages.CfgSampClkTimingResponse()

    @served
    def WriteAnalogF64(self, request: Any, context: Any) -> Any:
        values = np.array(request.write_array)
        written = self.device.write(self._task(request), values, request.timeout)
        return messages.WriteAnalogF64Response(samps_per_chan_written=written)

    @served
    def WriteAnalogScalarF64(self, request: Any, context: Any) -> Any:
        self.device.write_at_once(self._task(request), request.value)
        return messages.WriteAnalogScalarF64Response()

    @served
    def ReadAnalogF64(self, request: Any, context: Any) -> Any:
        return self._answer_read(request, request.num_samps_per_chan)

    def _answer_read(self, request: Any, n_samples: int) -> Any:
        assert request.fill_mode_raw == _GROUP_BY_CHANNEL
        values = self.device.read(self._task(request), n_samples, request.timeout)
        padded = np.zeros((values.shape[0], request.num_samps_per_chan))
        padded[:, : values.shape[1]] = values
        short = values.shape[1] < request.num_samps_per_chan
        return messages.ReadAnalogF64Response(
            status=NOT_YET if short else 0,
            read_array=padded.ravel().tolist(),
            samps_per_chan_read=values.shape[1],
        )

    @served
    def ResetDevice(self, request: Any, context: Any) -> Any:
        self.device.require(request.device_name)
        self.device.reset()
        return messages.ResetDeviceResponse()

    @served
    def GetErrorString(self, request: Any, context: Any) -> Any:
        return messages.GetErrorStringResponse(error_string=f"fault {request.error_code}")

    @served
    def GetSystemInfoAttributeUInt32(self, request: Any, context: Any) -> Any:
        return messages.GetSystemInfoAttributeUInt32Response(value=25)

    @served
    def GetSystemInfoAttributeString(self, request: Any, context: Any) -> Any:
        assert request.attribute_raw == _DEVICE_NAMES
        name = self.device.name if self.device.present else ""
        return messages.GetSystemInfoAttributeStringResponse(value=name)

    @served
    def GetDeviceAttributeString(self, request: Any, context: Any) -> Any:
        self.device.require(request.device_name)
        value = {
            _PRODUCT: "PCIe-6323",
            _INPUTS: self.device.listed("ai"),
            _OUTPUTS: self.device.listed("ao"),
        }[request.attribute_raw]
        return messages.GetDeviceAttributeStringResponse(value=value)

    @served
    def GetDeviceAttributeDouble(self, request: Any, context: Any) -> Any:
        self.device.require(request.device_name)
        value = {_INPUT_RATE: MAX_CONVERSIONS_HZ, _OUTPUT_RATE: MAX_OUTPUT_HZ}
        return messages.GetDeviceAttributeDoubleResponse(value=value[request.attribute_raw])

    @served
    def GetDeviceAttributeDoubleArray(self, request: Any, context: Any) -> Any:
        self.device.require(request.device_name)
        assert request.attribute_raw in {_INPUT_RANGES, _OUTPUT_RANGES}
        return messages.GetDeviceAttributeDoubleArrayResponse(value=[-RANGE_V, RANGE_V])

    @served
    def GetDeviceAttributeBool(self, request: Any, context: Any) -> Any:
        self.device.require(request.device_name)
        assert request.attribute_raw == _SIMULTANEOUS
        return messages.GetDeviceAttributeBoolResponse(value=self.device.at_one_time)

    @served
    def GetDeviceAttributeInt32(self, request: Any, context: Any) -> Any:
        self.device.require(request.device_name)
        assert request.attribute_raw == _BUS
        return messages.GetDeviceAttributeInt32Response(value_raw=self.device.bus)

    @served
    def SetChanAttributeInt32(self, request: Any, context: Any) -> Any:
        assert request.attribute_raw == _TRANSFER_CONDITION
        self.device.set_transfer(self._task(request), request.value_raw)
        return messages.SetChanAttributeInt32Response()

    @served
    def GetPhysicalChanAttributeInt32(self, request: Any, context: Any) -> Any:
        assert request.attribute_raw == _TERMINALS
        device, _, channel = request.physical_channel.partition("/")
        self.device.require(device)
        single_ended, differential = 1 + 2, 4
        bits = single_ended + differential * (int(channel.removeprefix("ai")) % 16 < 8)
        return messages.GetPhysicalChanAttributeInt32Response(value_raw=bits)

    @served
    def GetTaskAttributeString(self, request: Any, context: Any) -> Any:
        assert request.attribute_raw == _TASK_NAME
        return messages.GetTaskAttributeStringResponse(value=self._task(request).name)

    @served
    def GetReadAttributeUInt64(self, request: Any, context: Any) -> Any:
        assert request.attribute_raw == _ACQUIRED
        task = self.device.healthy(request.task.name)
        return messages.GetReadAttributeUInt64Response(value=task.acquired)

    @served
    def SetWriteAttributeInt32(self, request: Any, context: Any) -> Any:
        assert request.attribute_raw == _REGENERATION
        self._task(request).regenerates = request.value_raw == _REGENERATES
        return messages.SetWriteAttributeInt32Response()

    @served
    def SetBufferAttributeUInt32(self, request: Any, context: Any) -> Any:
        self._task(request).buffer = request.value
        return messages.SetBufferAttributeUInt32Response()

    @served
    def GetTimingAttributeDouble(self, request: Any, context: Any) -> Any:
        assert request.attribute_raw == _CONVERSION_RATE
        task = self._task(request)
        rate_hz = min(task.rate_hz * len(task.channels), MAX_CONVERSIONS_HZ)
        if self.device.at_one_time:
            rate_hz = AT_ONE_TIME_HZ
        return messages.GetTimingAttributeDoubleResponse(value=rate_hz)


class FakeServer:
    """Serves a device on a free port of this machine while its context lasts.

    With credentials only who has a certificate may speak to it.
    """

    def __init__(
        self, device: FakeDevice, credentials: grpc.ServerCredentials | None = None
    ) -> None:
        self.device = device
        self.servicer = FakeServicer(device)
        self._server = grpc.server(ThreadPoolExecutor(4, thread_name_prefix="fake-daq"))
        services.add_NiDAQmxServicer_to_server(self.servicer, self._server)
        anywhere = "127.0.0.1:0"
        port = (
            self._server.add_insecure_port(anywhere)
            if credentials is None
            else self._server.add_secure_port(anywhere, credentials)
        )
        self.address = f"127.0.0.1:{port}"

    def plan(self, fault: Fault) -> None:
        """Let one more thing go wrong."""
        self.servicer.faults.append(fault)

    def kill(self) -> None:
        """End the server at once; its device plays on."""
        self._server.stop(None).wait()

    def __enter__(self) -> Self:
        self._server.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.kill()
