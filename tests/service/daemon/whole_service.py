"""A whole service with a simulated rig, as the tests of its processes start it."""

from collections.abc import Iterator
from typing import Any

import frictus
from frictus_service.config import ApiConfig, Config, Limits, RouterConfig
from frictus_service.processes import free_endpoint

TEXTURE = frictus.Spectrum(components=[frictus.Component(amplitude_n=0.08, cycles_per_mm=1.0)])


def config_with(backend: Any) -> Config:
    endpoint = free_endpoint()
    return Config(
        backend=backend,
        router=RouterConfig(endpoint=endpoint),
        api=ApiConfig(port=0),
        limits=Limits(freeze_ms=500, missed_deadlines=1_000),  # for busy machines
    )


def blocks_of(feed: Any) -> Iterator[frictus.Block]:
    for item in feed:
        assert isinstance(item, frictus.Block), f"this subscriber lost blocks: {item}"
        yield item


def driven(block: frictus.Block) -> bool:
    return bool(block.data.any())
