"""A rig on a virtual clock whose output is on."""

from typing import Any

from frictus.textures import Scene

SETTLED_S = 0.5
PERIOD = 20
"""Samples in which the carrier takes all its phases."""


def driven(bench: Any, texture: Scene, lease_s: float = 10.0) -> Any:
    """Return the bench armed, its finger followed, its output on."""
    bench.play(texture)
    bench.turn(0.2)
    bench.arm(lease_s)
    turns = bench.turn(SETTLED_S)
    assert any(turn.exchange.voltage_v.any() for turn in turns)
    return bench
