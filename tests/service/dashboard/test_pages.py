"""The page's files: with strict headers, and nothing beside them."""

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from frictus_dashboard import FOLDER
from frictus_service.api.dashboard import pages

FILES = sorted(
    path.relative_to(FOLDER).as_posix() for path in FOLDER.rglob("*") if path.is_file()
)


@pytest.fixture(scope="module")
def client() -> TestClient:
    app = FastAPI()
    app.include_router(pages.router)
    app.mount(pages.PAGE, pages.DashboardFiles())
    return TestClient(app, base_url="http://127.0.0.1:8420")


def test_the_root_leads_to_the_page(client: TestClient) -> None:
    answer = client.get("/", follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (307, "/dashboard/")
    page = client.get("/")
    assert page.status_code == 200
    assert page.headers["content-type"] == "text/html; charset=utf-8"


@pytest.mark.parametrize("file", FILES)
def test_every_file_has_the_headers(client: TestClient, file: str) -> None:
    answer = client.get(f"/dashboard/{file}")
    assert answer.status_code == 200
    assert answer.content == (FOLDER / file).read_bytes()
    for name, value in pages.HEADERS.items():
        assert answer.headers[name] == value
    if file.endswith(("js", "css", "html")):
        assert answer.headers["content-type"].startswith("text/")
        assert "plain" not in answer.headers["content-type"]
    kept = client.get(f"/dashboard/{file}", headers={"If-None-Match": answer.headers["etag"]})
    assert kept.status_code == 304
    assert kept.headers["content-security-policy"] == pages.HEADERS["Content-Security-Policy"]


@pytest.mark.parametrize("path", ["../__init__.py", "%2e%2e/__init__.py", "none.js", "vendor"])
def test_nothing_else_is_served(client: TestClient, path: str) -> None:
    assert client.get(f"/dashboard/{path}").status_code == 404


def test_nothing_inline_may_run() -> None:
    policy = pages.HEADERS["Content-Security-Policy"]
    assert "unsafe" not in policy
    assert policy.startswith("default-src 'none'")
    index = (FOLDER / "index.html").read_text(encoding="utf-8").lower()
    assert "<style" not in index
    assert " style=" not in index
    assert index.count("<script") == index.count('<script type="module" src=')
