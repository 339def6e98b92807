"""The script that fits the shipped textures leaves them whole, whatever the disk does."""

import runpy
import sys
from pathlib import Path

import pytest
from tests.full_disk import full_after

SCRIPT = Path(__file__).parents[2] / "bench" / "fit_textures.py"


def test_a_full_disk_leaves_the_textures_of_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = runpy.run_path(str(SCRIPT))
    main = script["main"]
    out = tmp_path / "textures"
    main.__globals__["OUT"] = out
    monkeypatch.setattr(sys, "argv", ["fit_textures", str(tmp_path)])
    main()
    (fitted,) = out.iterdir()
    whole = fitted.read_bytes()
    with pytest.raises(OSError, match="too large"), full_after(1_000):
        main()
    assert {path: path.read_bytes() for path in out.iterdir()} == {fitted: whole}
