"""The tracker as a part of the service."""

import threading
from pathlib import Path

import numpy as np
import pytest
from tests.service.calibration.test_prior import people

from frictus_service.config import Config, RegistryConfig, TrackerConfig
from frictus_service.errors import ConfigurationError
from frictus_service.registry.store import Registry
from frictus_service.tracking.process import population_of, run_tracker


@pytest.mark.parametrize("content", [None, "no mount"])
def test_a_mount_that_cannot_be_read_is_told_by_its_key(
    content: str | None, tmp_path: Path
) -> None:
    file = tmp_path / "papr"
    if content is not None:
        file.write_text(content, encoding="ascii")
    config = Config(tracker=TrackerConfig(mount=file))
    with pytest.raises(ConfigurationError, match=r"tracker\.mount: .*'paper', 'none'"):
        run_tracker(config, threading.Event(), threading.Event())


def test_on_a_real_rig_it_begins_from_people_alone(
    rng: np.random.Generator, tmp_path: Path
) -> None:
    config = Config(registry=RegistryConfig(url=f"sqlite:///{(tmp_path / 'r.db').as_posix()}"))
    with Registry(config.registry.url) as registry:
        for number, model in enumerate(people(rng, 8)):
            told = {"source": "a test", "simulated": number < 2}
            published = model.model_copy(update={"provenance": told})
            registry.publish(published, f"rig1/P{number}", by="ann")
    said = list[str]()
    assert population_of(config, True, said.append).n == 8
    assert population_of(config, False, said.append).n == 6
    assert not said
