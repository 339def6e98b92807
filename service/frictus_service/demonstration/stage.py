"""A texture under a simulated finger, for whoever opens the page: `frictus demo --page`."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

import frictus
from frictus.textures import Scene
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.config import FingerConfig, SimulatedParticipant
from frictus_service.config import (
    LOCAL,
    ApiConfig,
    Config,
    Limits,
    RegistryConfig,
    RouterConfig,
)
from frictus_service.daemon.processes.child_process import PartName
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.processes import free_endpoint

START_S: Final = 120.0
"""The first start on a machine compiles."""
LOOK_S: Final = 0.2
STARTED_S: Final = 5.0
PATIENT: Final = Limits(missed_deadlines=1_000, freeze_ms=2_500)
"""No finger is there that a late block could surprise, and the machine may be busy: a browser
starts beside the rig, and takes every core for a while."""
LEASE_MS: Final = 10_000
"""Likewise, of the terminal and of pages; whoever ends the demo disarms."""
AS_PLACEHOLDER: Final = SimulatedParticipant()
"""A person whom the placeholder model fits."""
SHOWN: Final[tuple[PartName, ...]] = ("rig", "api")
"""What the first look needs; the rest starts under it."""


def demo_config(
    folder: Path,
    finger: FingerConfig,
    port: int,
    seed: int,
    participant: SimulatedParticipant = AS_PLACEHOLDER,
) -> Config:
    """Return a configuration that disturbs nothing else on this machine.

    Parameters
    ----------
    folder : Path
        For all that is written.
    finger : FingerConfig
        How the simulated finger moves.
    port : int
        Of the API; 0: any.
    seed : int
        Of the finger's way and the sensors' noise.
    participant : SimulatedParticipant
        Whose finger it is.
    """
    return Config(
        site="demo",
        rig="demo",
        textures=folder / "textures",
        recordings=folder / "recordings",
        studies=folder / "studies",
        registry=RegistryConfig(url=f"sqlite:///{(folder / 'frictus.db').as_posix()}"),
        backend=SimulatedConfig(seed=seed, finger=finger, participant=participant),
        limits=PATIENT,
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=port, page_lease_ms=LEASE_MS),
    )


def stage(
    config: Config,
    scene: Scene,
    say: Callable[[str], None],
    show: Callable[[str], None],
    over: threading.Event,
) -> None:
    """Play a scene on a rig, shared with every page of this machine, until it is over.

    Parameters
    ----------
    config : Config
        A simulated rig and an API without tokens.
    scene : Scene
        What the screen feels like.
    say : callable
        Told what goes on.
    show : callable
        Gets the address of the page once there is something to see.
    over : Event
        Ends it.

    Raises
    ------
    FrictusError
        If the rig does not start or refuses.
    """
    with Supervisor(config, say=say) as supervisor:
        supervisor.wait_ready(START_S, SHOWN)
        # It arms, too; but no finger is there that a link of 4 s could surprise.
        endpoint = config.router.endpoint
        with frictus.connect(endpoint, "demo-terminal", patient=True) as client:
            rig = client.rig(config.rig, config.site, wait_s=STARTED_S)
            rig.set_scene(scene)
            lease = rig.arm(LEASE_MS, share_with=(LOCAL,))
            try:
                show(f"http://{config.api.host}:{config.api.port}/#/live/{config.rig}")
                while not (over.wait(LOOK_S) or lease.lost):
                    pass
                if lease.lost:
                    say(f"the rig is not driven any more: {lease.reason}; arm it on the page")
                over.wait()
            finally:
                lease.disarm()
