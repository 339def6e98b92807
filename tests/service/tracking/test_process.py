"""The tracker as a part of the service."""

import threading
from pathlib import Path

import pytest

from frictus_service.config import Config, TrackerConfig
from frictus_service.errors import ConfigurationError
from frictus_service.tracking.process import run_tracker


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
