"""What an export makes stays no longer than it must."""

import os
import tempfile
import time
from pathlib import Path

import pytest

from frictus_service.api import exports


def test_what_a_killed_service_left_is_removed_a_day_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for name, age_s in (
        ("frictus-export-old", exports.LEFT_S + 60.0),
        ("frictus-export-new", 0.0),
        ("of-another-program", exports.LEFT_S + 60.0),
    ):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "pilot.h5").write_bytes(b"trials")
        at_s = time.time() - age_s
        os.utime(folder, (at_s, at_s))
    exports.remove_left_exports()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "frictus-export-new",
        "of-another-program",
    ]
    assert (tmp_path / "of-another-program" / "pilot.h5").exists()
