"""Studies over REST: what is sent becomes a study of the folder, or is refused in words."""

import asyncio
import errno
import os
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest
from fastapi import Request
from fastapi.testclient import TestClient
from starlette.types import Message
from tests.blind.generator.case import Case, Design
from tests.blind.generator.study import Seeds, make_study
from tests.service.api.conftest import TOKENS, Serve

from frictus_service.api import uploads
from frictus_service.durable import LEFT_S, put_in_free_place

DESIGN = Design(participants=1, n_tones=1, n_speeds=1, n_forces=1, seconds=0.5)
TYPE = {"Content-Type": "application/x-hdf5"}


@pytest.fixture
def study(tmp_path: Path, rng: np.random.Generator) -> bytes:
    path = tmp_path / "made.h5"
    make_study(path, Case("test", (), DESIGN), Seeds(*map(int, rng.integers(2**31, size=2))))
    return path.read_bytes()


def folder_of(tmp_path: Path) -> list[str]:
    folder = tmp_path / "studies"
    return sorted(path.name for path in folder.iterdir() if path.is_file())


def test_a_study_that_is_sent_is_kept_and_listed(
    api: TestClient, study: bytes, tmp_path: Path
) -> None:
    answer = api.put("/v1/studies/visit_1.h5", content=study, headers=TYPE)
    assert answer.status_code == 201, answer.text
    assert answer.json()["bytes"] == len(study)
    assert (tmp_path / "studies" / "visit_1.h5").read_bytes() == study
    assert folder_of(tmp_path) == ["visit_1.h5"]  # nothing unfinished beside it
    assert api.get("/v1/studies").json()["studies"] == [answer.json()]


def test_no_study_is_replaced(api: TestClient, study: bytes, tmp_path: Path) -> None:
    place = tmp_path / "studies" / "visit.h5"
    place.parent.mkdir()
    place.write_bytes(b"of somebody")
    answer = api.put("/v1/studies/visit.h5", content=study, headers=TYPE)
    assert (answer.status_code, answer.json()["code"]) == (409, "study_exists")
    assert "choose another name" in answer.json()["detail"]
    assert place.read_bytes() == b"of somebody"


@pytest.mark.parametrize("content", [b"", b"no study", "hdf5 of something else", "torn"])
def test_what_is_no_study_is_refused_in_words_and_not_kept(
    api: TestClient, content: bytes | str, study: bytes, tmp_path: Path
) -> None:
    if content == "torn":
        content = study[: len(study) // 2]
    elif isinstance(content, str):
        with h5py.File(tmp_path / "other.h5", "w") as file:
            file["mice"] = np.arange(3)
        content = (tmp_path / "other.h5").read_bytes()
    answer = api.put("/v1/studies/visit.h5", content=content, headers=TYPE)
    assert (answer.status_code, answer.json()["code"]) == (422, "bad_request")
    told = answer.json()["detail"]
    assert told.startswith("visit.h5")
    assert uploads.UNFINISHED not in told
    assert folder_of(tmp_path) == []
    assert api.get("/v1/studies").json()["studies"] == []


@pytest.mark.parametrize(
    "name",
    ["visit.mat", ".h5", ".upload-1.h5", "..h5", "a%2Fb.h5", "..%2Fvisit.h5", "a b.h5",
     "é.h5", "x" * 97 + ".h5", "con.h5", "Nul.1.h5"],
)  # fmt: skip
def test_names_that_no_study_may_have(api: TestClient, name: str, tmp_path: Path) -> None:
    answer = api.put(f"/v1/studies/{name}", content=b"x", headers=TYPE)
    assert answer.status_code in (404, 405, 422)
    assert "pattern" not in answer.text
    assert not (tmp_path / "studies").exists()


def test_a_disk_that_refuses_at_the_end_leaves_the_name_free(
    api: TestClient, study: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_written: Path, _path: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as meanwhile:
        meanwhile.setattr(uploads, "put_in_free_place", full)
        answer = api.put("/v1/studies/visit.h5", content=study, headers=TYPE)
    assert (answer.status_code, answer.json()["code"]) == (507, "not_stored")
    assert folder_of(tmp_path) == []
    assert api.put("/v1/studies/visit.h5", content=study, headers=TYPE).status_code == 201


def test_of_a_full_disk_the_rest_of_the_body_is_read_before_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or the connection of whoever still sends is reset, and the answer lost with it."""
    left = [b"x" * 1_000] * 8

    async def receive() -> Message:
        return {"type": "http.request", "body": left.pop(), "more_body": bool(left)}

    async def full(pieces: AsyncIterator[bytes], _into: Path) -> None:
        async for _ in pieces:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(uploads, "_write", full)
    request = Request({"type": "http", "headers": []}, receive)
    with pytest.raises(OSError, match="No space left"):
        asyncio.run(uploads._receive(request, tmp_path / "study.h5"))
    assert not left


def test_of_two_that_come_at_once_one_gets_the_name(
    api: TestClient, study: bytes, tmp_path: Path
) -> None:
    with ThreadPoolExecutor(2) as threads:
        asked = [
            threads.submit(api.put, "/v1/studies/visit.h5", content=study, headers=TYPE)
            for _ in range(2)
        ]
        codes = sorted(one.result(60.0).status_code for one in asked)
    assert codes in ([201, 409], [201, 503])  # one address has half of the places
    assert folder_of(tmp_path) == ["visit.h5"]


def test_a_study_that_came_while_another_was_sent_is_not_replaced(
    api: TestClient, study: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "studies" / "visit.h5"

    def late(written: Path, path: Path) -> None:
        place.write_bytes(b"of another process")
        put_in_free_place(written, path)

    monkeypatch.setattr(uploads, "put_in_free_place", late)
    answer = api.put("/v1/studies/visit.h5", content=study, headers=TYPE)
    assert (answer.status_code, answer.json()["code"]) == (409, "study_exists")
    assert place.read_bytes() == b"of another process"
    assert folder_of(tmp_path) == ["visit.h5"]


def test_a_study_that_is_too_large_is_not_read_to_its_end(
    api: TestClient, study: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "MAX_STUDY_BYTES", len(study) - 1)
    for content in (study, iter([study])):  # the latter without a length that is announced
        answer = api.put("/v1/studies/visit.h5", content=content, headers=TYPE)
        assert (answer.status_code, answer.json()["code"]) == (413, "too_large")
        assert "folder of the studies" in answer.json()["detail"]
        assert folder_of(tmp_path) == []


def test_what_a_killed_process_left_is_taken_away_and_what_is_under_way_is_not(
    api: TestClient, study: bytes, tmp_path: Path
) -> None:
    folder = tmp_path / "studies"
    folder.mkdir()
    for name, age_s in (("old", LEFT_S + 60.0), ("new", 0.0)):
        left = folder / f"{uploads.UNFINISHED}{name}.h5"
        left.touch()
        os.utime(left, (left.stat().st_mtime - age_s,) * 2)
    assert api.put("/v1/studies/a.h5", content=study, headers=TYPE).status_code == 201
    assert folder_of(tmp_path) == [f"{uploads.UNFINISHED}new.h5", "a.h5"]
    assert [one["name"] for one in api.get("/v1/studies").json()["studies"]] == ["a.h5"]


def test_who_may_only_look_may_not_add_one(serve: Serve, study: bytes, tmp_path: Path) -> None:
    api = serve(tokens=True)
    token = {"Authorization": f"Bearer {TOKENS['render']}"}
    answer = api.put("/v1/studies/visit.h5", content=study, headers=TYPE | token)
    assert (answer.status_code, answer.json()["code"]) == (403, "missing_scope")
    assert not (tmp_path / "studies").exists()
