"""The rig process: backend, loop, publisher and commands, put together and taken down."""

import contextlib
import secrets
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import zenoh

from frictus.calls import present_rigs
from frictus.errors import FrameError, TextureError
from frictus.keys import RigKeys
from frictus.model import Model
from frictus.session import open_session
from frictus_hardware.physics.screen import Screen
from frictus_service import json_text
from frictus_service.config import Config
from frictus_service.daemon.block_loop.lead import RetryingBackend
from frictus_service.daemon.block_loop.loop import BlockLoop
from frictus_service.daemon.commands import Commands
from frictus_service.daemon.control import Control, Interlock
from frictus_service.daemon.inboxes import LoopInbox, ModelSlot
from frictus_service.daemon.model_controller import ModelController, remarks_on, rendered_model
from frictus_service.daemon.preparation import (
    RealTimeBudget,
    budget_for,
    raise_priority,
    warm_up,
)
from frictus_service.daemon.publisher import Publisher
from frictus_service.daemon.safety import FormerRun, Safety
from frictus_service.daemon.scene_controller import SceneController
from frictus_service.errors import ConfigurationError, StartError
from frictus_service.processes import (
    CALLS_PRIORITY,
    LOOP_PRIORITY,
    PUBLISHER_PRIORITY,
    Heartbeat,
    ReadySignal,
    garbage_collection_off,
)
from frictus_service.security.members import tls_of_rig
from frictus_service.synthesis.compensability import (
    inverse_of_model,
    placeholder_model,
    screen_of,
)

JOIN_S: Final = 5.0
SWITCH_S: Final = 2e-4
"""After so long a thread gives the interpreter's lock to one that waits for it. Python's own
5 ms are a whole block, for which any thread that computes could hold up the loop."""


def run_rig(
    config: Config,
    heartbeat: Heartbeat,
    ready: ReadySignal,
    stop: threading.Event,
    former: FormerRun | None = None,
    say: Callable[[str], None] = lambda _line: None,
    on_step: Callable[[str], None] = lambda _step: None,
) -> None:
    """Run a rig until told to stop; then ramp to zero, disarm and close.

    Parameters
    ----------
    config : Config
        Of the service.
    heartbeat : Heartbeat
        Counts the loop's turns; 0 until the loop runs.
    ready : ReadySignal
        Set once the rig is present on the network.
    stop : threading.Event
        Ends the rig.
    former : FormerRun or None
        Why the rig had to be started again.
    say : callable
        Told what an operator should know.
    on_step : callable
        Told each step of the start as it begins.

    Raises
    ------
    ConfigurationError, HardwareError, LinkError
        Where the rig cannot start.
    StartError
        Where one of its threads ended by itself.
    """
    model = read_model(config.model_file)
    heartbeat.value = 0
    on_step("rendering everything once")
    loop = config.clock_scale * warm_up(config.sample_rate_hz, config.block_samples)
    real_time = budget_for(loop)
    raise_priority(CALLS_PRIORITY, real_time)  # threads begin with that of who starts them
    with open_session(config.router.endpoint, tls=tls_of_rig(config)) as session:
        if former is None:  # a rig that is started again shall be back soon
            say_if_present(session, config.keys, say)
        on_step(f"opening the device ({config.backend.kind})")
        with _opened(config) as backend:
            rig = _Parts(config, backend, model, heartbeat, former, real_time, say)
            with rig.commands, rig.running(session, say):
                rig.commands.declare(session, config.keys)
                with contextlib.closing(_Token(session, config.keys.alive)):
                    ready.set()
                    rig.wait(stop)


def say_if_present(session: zenoh.Session, keys: RigKeys, say: Callable[[str], None]) -> None:
    """Warn where another rig has this name already: each ends the leases of the other."""
    if keys in present_rigs(session, keys.site):
        say(
            f"another rig {keys.rig} at {keys.site} is present, and each ends the other's "
            "leases: end one, or give this one another name (`rig` of the configuration)"
        )


def read_model(path: Path | None) -> Model:
    """Return the configured model, or the placeholder.

    Raises
    ------
    ConfigurationError
        If the file does not hold a `model/1` document of friction.
    """
    if path is None:
        return placeholder_model()
    try:
        model = Model.model_validate_json(json_text.read_file(path), strict=True)
        inverse_of_model(model, Screen())
    except (OSError, ValueError, FrameError, TextureError) as error:
        raise ConfigurationError(f"model_file {path}: {error}") from error
    return model


@contextlib.contextmanager
def _opened(config: Config) -> Iterator[RetryingBackend]:
    device = config.backend.make()
    device.open()
    backend = RetryingBackend(device, time.monotonic_ns)
    try:
        yield backend
    finally:
        backend.close()


class _Token:
    """The rig's liveliness token: while it stands, the rig is present."""

    def __init__(self, session, key: str) -> None:  # type: ignore[no-untyped-def]
        self._token = session.liveliness().declare_token(key)

    def close(self) -> None:
        self._token.undeclare()


class _Parts:
    """What a rig consists of, wired."""

    def __init__(
        self,
        config: Config,
        backend: RetryingBackend,
        model: Model,
        heartbeat: Heartbeat,
        former: FormerRun | None,
        real_time: RealTimeBudget,
        say: Callable[[str], None],
    ) -> None:
        info = backend.info
        self.config = config
        self.real_time = real_time
        self.backend = backend
        self.former = former
        fault = None if former is None else (former.fault.kind, former.fault.reason)
        self.interlock = Interlock(Safety(fault=fault))
        rendered = rendered_model(model, screen_of(info))
        if said := remarks_on(rendered, screen_of(info)):
            say(f"the model: {said}")
        self.orders = LoopInbox(ModelSlot(rendered))
        self.info = info
        self.stage = SceneController(
            screen_of(info),
            info.sample_rate_hz,
            self.interlock,
            self.orders,
            time.monotonic,
        )
        self.models = ModelController(
            screen_of(info),
            self.interlock,
            self.orders,
            self.stage,
            time.monotonic,
            config.tracker.policy,
            say,
        )
        self.loop = BlockLoop(
            backend,
            config,
            self.interlock,
            self.orders,
            heartbeat,
            secrets.randbits(31),
            time.monotonic_ns,
            time.time_ns,
        )
        control = Control(self.interlock, backend.inner, config.limits, time.monotonic)
        self.commands = Commands(
            control, self.stage, self.models, self.interlock, config.limits
        )
        self.failed: list[BaseException] = []
        self._ended = threading.Event()

    @contextlib.contextmanager
    def running(self, session, say: Callable[[str], None]) -> Iterator[None]:  # type: ignore[no-untyped-def]
        """Run loop and publisher in threads; at the end the loop stops first."""
        publisher = Publisher(
            session,
            self.config.keys,
            self.info,
            self.config.block_samples,
            self.config.limits.force_limit_n,
            self.loop,
            self.interlock,
            self.stage,
            self.models,
            self.commands,
            time.monotonic,
            time.time_ns,
            say,
            self.former,
        )
        stop_loop, stop_publisher = threading.Event(), threading.Event()
        loop = self._thread("frictus-loop", lambda: self._loop(stop_loop, say))

        def publish() -> None:
            raise_priority(PUBLISHER_PRIORITY, self.real_time)
            publisher.run_until(stop_publisher)

        publishing = self._thread("frictus-publisher", publish)
        with garbage_collection_off():
            switch_s = sys.getswitchinterval()
            sys.setswitchinterval(SWITCH_S)
            loop.start()
            publishing.start()
            try:
                yield
            finally:
                stop_loop.set()
                loop.join(JOIN_S)
                stop_publisher.set()
                publishing.join(JOIN_S)
                sys.setswitchinterval(switch_s)

    def wait(self, stop: threading.Event) -> None:
        """Wait until told to stop, or until a thread has ended by itself.

        Raises
        ------
        StartError
            In the latter case.
        """

        def end_on_stop() -> None:
            stop.wait()
            self._ended.set()

        threading.Thread(target=end_on_stop, name="frictus-stop", daemon=True).start()
        self._ended.wait()
        if self.failed:
            error = self.failed[0]
            raise StartError(f"{type(error).__name__}: {error}") from error

    def _loop(self, stop: threading.Event, say: Callable[[str], None]) -> None:
        say(f"loop priority: {raise_priority(LOOP_PRIORITY, self.real_time)}")
        # The device's clock began with the first opening, and what came since took longer
        # than the lead: begin anew, so that no rig starts with underruns.
        self.loop.begin_anew()
        self.loop.run_until(stop)

    def _thread(self, name: str, target: Callable[[], None]) -> threading.Thread:
        def run() -> None:
            try:
                target()
            except BaseException as error:
                self.failed.append(error)
                self._ended.set()

        return threading.Thread(target=run, name=name, daemon=True)
