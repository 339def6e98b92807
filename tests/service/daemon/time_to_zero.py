"""How long the output lasts after each cause that ends it, on the simulated rig as it ships.

Counted in samples of the device, so that a busy machine does not change it.
"""

from collections.abc import Callable
from typing import Final
from unittest.mock import patch

import numpy as np

from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.simulated.faults import MonitorMismatch, Raised, SilentTouch
from frictus_service.daemon.safety import ClientVanished, Disarm, Stop
from frictus_service.synthesis.renderer import Renderer

from .conftest import Bench, build_bench

LEASE_S: Final = 1.0
TEXTURE: Final = Scene(
    regions=[
        Region(texture=Spectrum(components=[Component(amplitude_n=0.08, cycles_per_mm=2.0)]))
    ]
)


def _raise(error: str) -> Callable[[Bench], None]:
    def inject(bench: Bench) -> None:
        fault = Raised.model_validate({"at_sample": bench.clock.sample(), "error": error})
        bench.rig.faults.add(fault)

    return inject


def _lose_sensor(bench: Bench) -> None:
    _raise("sensor")(bench)
    bench.rig.health = lambda: "the sensor is gone"  # type: ignore[method-assign]


def _press_hard(bench: Bench) -> None:
    bench.loop._checks._force_limit_n = 0.01


def _contradict(bench: Bench) -> None:
    bench.rig.faults.add(MonitorMismatch(at_sample=bench.clock.sample(), factor=0.5))


def _silence(bench: Bench) -> None:
    bench.rig.faults.add(SilentTouch(at_sample=bench.clock.sample()))


def _break_once(bench: Bench) -> None:
    with patch.object(Renderer, "render", side_effect=ZeroDivisionError("a bug")):
        bench.loop.turn()


def _be_late(bench: Bench) -> None:
    limit = bench.config.limits.missed_deadlines
    for _ in range(limit):
        bench.delay_ns += 6_000_000
        bench.turn(0.005)


CAUSES: Final[dict[str, Callable[[Bench], None]]] = {
    "stop": lambda bench: bench.feed(Stop("ben")),
    "disarm": lambda bench: bench.feed(Disarm("ann")),
    "owner's token fell": lambda bench: bench.feed(ClientVanished("ann")),
    "lease over": lambda _bench: None,
    "no touch report any more": _silence,
    "sensor lost": _lose_sensor,
    "force beyond its limit": _press_hard,
    "monitor contradicts the drive": _contradict,
    "blocks late in a row": _be_late,
    "loop exception": _break_once,
    "stream lost": _raise("stream_lost"),
    "device lost": _raise("device_lost"),
    "link lost": _raise("link_lost"),
}
LIMITS_MS: Final = {"no touch report any more": 100.0, "blocks late in a row": 200.0}
"""How long a cause may last before it counts, by the standard configuration."""


def time_to_zero_ms(cause: str, phase: int) -> float:
    """Return how long there was output after a cause, and make sure that there was before.

    Parameters
    ----------
    cause : str
        One of `CAUSES`.
    phase : int
        Blocks that the finger is further on its way.
    """
    bench = build_bench()
    bench.play(TEXTURE)
    bench.turn(0.2 + 0.005 * phase)
    bench.arm(LEASE_S if cause == "lease over" else 10.0)
    armed = bench.clock.sample()
    bench.turn(0.5)
    if cause == "lease over":
        since = armed + round(LEASE_S * bench.rate_hz)
    else:
        since = bench.clock.sample()
        CAUSES[cause](bench)
    bench.turn(0.8)
    (run, *_) = (turn.run for turn in bench.turns)
    volts = np.concatenate([turn.exchange.voltage_v for turn in bench.turns if turn.run == run])
    (played,) = np.nonzero(volts)
    assert played[-1] > armed + 0.2 * bench.rate_hz, "nothing was driven"
    return float(1e3 * max(played[-1] + 1 - since, 0) / bench.rate_hz)
