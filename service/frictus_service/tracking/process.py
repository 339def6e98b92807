"""The tracker as a part of the service: follows its rig whenever it is there."""

import threading
from collections.abc import Callable
from typing import Final

import frictus
from frictus.errors import LinkError, NoRigError, SilenceError
from frictus.keys import Topics
from frictus.session import declare_latest_publisher
from frictus_service.calibration.coordinates import Prior, of_people
from frictus_service.config import Config
from frictus_service.errors import ConfigurationError, FieldError, PriorError, RegistryError
from frictus_service.processes import ReadySignal
from frictus_service.registry.store import Registry, earlier_people
from frictus_service.security.members import tls_of_rig
from frictus_service.study.trial import read_mount
from frictus_service.tracking.audit import ModelChangeLog
from frictus_service.tracking.live import LiveTracker

NAME: Final = "tracker"
"""Of the client by which a rig knows it."""
AGAIN_S: Final = 1.0
TIMEOUT_S: Final = 2.0


def run_tracker(
    config: Config,
    ready: ReadySignal,
    stop: threading.Event,
    say: Callable[[str], None] = lambda _line: None,
) -> None:
    """Follow the finger on the configured rig until told to stop.

    Parameters
    ----------
    config : Config
        Of the service.
    ready : Event
        Set once the rig, should it be there, is listened to.
    stop : threading.Event
        Ends it.
    say : callable
        Told what an operator should know.

    Raises
    ------
    LinkError
        If no router answers.
    ConfigurationError
        If the configured mount cannot be read.
    """
    try:
        mount = read_mount(config.tracker.mount)
    except (FieldError, OSError) as error:
        raise ConfigurationError(
            f"tracker.mount: {error}; accepted: 'paper', 'none', or a file as `frictus mount` "
            "writes it"
        ) from error
    with frictus.connect(
        config.router.endpoint,
        name=NAME,
        timeout_s=TIMEOUT_S,
        tls=tls_of_rig(config),
        patient=True,
    ) as client:
        key = config.keys.of(Topics.ESTIMATE)
        publisher = declare_latest_publisher(client.session, key, Topics.ESTIMATE)
        ready.set()
        said = ""
        while not stop.is_set():
            try:
                rig = client.rig(config.rig, config.site)
                with LiveTracker(
                    rig,
                    mount,
                    population_of(config, rig.status().simulated, say),
                    lambda state: publisher.put(state.to_json()),
                    ModelChangeLog(config.tracker.audit),
                ) as live:
                    said = ""
                    live.follow(stop.is_set)
            except (NoRigError, SilenceError, LinkError) as error:
                if str(error) != said:
                    said = str(error)
                    say(f"waits for its rig: {said}")
                stop.wait(AGAIN_S)


def population_of(config: Config, simulated_rig: bool, say: Callable[[str], None]) -> Prior:
    """Return what is known of people from whom models were published.

    Parameters
    ----------
    config : Config
        With the registry.
    simulated_rig : bool
        A real one learns nothing from simulated participants.
    say : callable
        Told where it cannot be read.
    """
    registry = Registry(config.registry.url)
    if not registry.database.exists:
        return Prior.weak()
    try:
        with registry:
            return Prior.learn(of_people(earlier_people(registry, ""), simulated_rig))
    except (RegistryError, PriorError) as error:
        say(f"begins from a weak prior, since earlier models cannot be read: {error}")
        return Prior.weak()
