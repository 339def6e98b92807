"""A service in real time whose rig plays to a person whom nobody measured."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.patience import PATIENT

import frictus
from frictus.keys import Topics
from frictus.messages import AdaptationPolicy, EstimateState
from frictus.model import Model
from frictus.recordings import texture_of
from frictus.rig import Rig
from frictus.textures import Region, Scene
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_hardware.simulated.faults import Fault
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import (
    ApiConfig,
    Config,
    RegistryConfig,
    RouterConfig,
    TrackerConfig,
)
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.library import SHIPPED
from frictus_service.processes import free_endpoint

PERSON = SimulatedParticipant(gain_n=0.3, cutoff_0_hz=700.0, slope_hz_per_mm_s=25.0)
PATIENCE_S = 100.0


def config_in(
    folder: Path,
    policy: AdaptationPolicy = "observe",
    rig: str = "rig1",
    person: SimulatedParticipant = PERSON,
    faults: tuple[Fault, ...] = (),
) -> Config:
    return Config(
        rig=rig,
        backend=SimulatedConfig(
            finger=SteadyStrokes(speed_mm_s=40.0),
            participant=person,
            lead_ms=100.0,
            faults=faults,
        ),
        block_ms=10.0,
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=0),
        registry=RegistryConfig(url=f"sqlite:///{(folder / 'frictus.db').as_posix()}"),
        tracker=TrackerConfig(policy=policy, audit=folder / "audit" / "changes.jsonl"),
        limits=PATIENT,
    )


@contextmanager
def playing(
    config: Config, *parts: str, model: Model | None = None
) -> Iterator[tuple[Supervisor, Rig]]:
    """A texture plays on an armed rig, by a model that is set beforehand, if any."""
    flat = texture_of((SHIPPED / "flat.json").read_text(encoding="utf-8"))
    with Supervisor(config, ("rig", *parts), say=lambda _line: None) as supervisor:  # type: ignore[arg-type]
        supervisor.wait_ready(PATIENCE_S)
        with frictus.connect(config.router.endpoint, "test") as client:
            rig = client.rig(config.rig, wait_s=5.0)
            if model is not None:
                rig.set_model(model)
            rig.set_scene(Scene(regions=[Region(texture=flat, gain=0.5)]))
            with rig.arm(lease_ms=10_000):
                yield supervisor, rig


def follows(told: EstimateState) -> bool:
    """Return whether the model was adapted, and predicts well since."""
    return bool(told.changes) and told.error_db.get("in_force", 9.0) < 0.3


def first(rig: Rig, holds: Callable[[EstimateState], bool]) -> EstimateState:
    """Return the first estimate for which something holds."""
    with rig.watch(Topics.ESTIMATE, timeout_s=PATIENCE_S) as states:
        for state in states:
            assert isinstance(state, EstimateState)
            if holds(state):
                return state
    raise AssertionError("the feed has ended")
