"""What only bears the name of a texture, a recording or a study fails no list of them."""

import os
import sys
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from tests.service.api.conftest import Serve

from frictus_service.recording.summary import unfinished


@pytest.fixture
def api(serve: Serve, tmp_path: Path) -> TestClient:
    return serve(recordings=tmp_path / "recordings")


@pytest.mark.skipif(sys.platform == "win32", reason="no pipes with names there")
@pytest.mark.parametrize(
    ("kind", "suffix", "one"),
    [
        ("textures", ".json", "/v1/textures/{}"),
        ("recordings", ".mcap", "/v1/recordings/{}/recording.mcap"),
        ("studies", ".h5", None),
    ],
)
def test_what_is_no_file_is_left_out(
    api: TestClient, tmp_path: Path, kind: str, suffix: str, one: str | None
) -> None:
    folder = tmp_path / kind
    folder.mkdir(exist_ok=True)
    (folder / f"folder{suffix}").mkdir()
    os.mkfifo(folder / f"pipe{suffix}")
    (folder / f"loop{suffix}").symlink_to(folder / f"loop{suffix}")
    (folder / f"dangling{suffix}").symlink_to("nowhere")
    names = ("folder", "pipe", "loop", "dangling")
    listed = api.get(f"/v1/{kind}")
    assert listed.status_code == 200
    assert not {each["name"].removesuffix(suffix) for each in listed.json()[kind]} & {*names}
    for name in names:
        if one is not None:
            answer = api.get(one.format(name))
        else:
            answer = api.post("/v1/discoveries", json={"study": f"{name}{suffix}"})
        assert answer.status_code == 404, answer.text
    assert unfinished(folder) is None  # as the recorder asks at its start
