"""The TypeScript client: its types are the code's, it works in Node, it can be installed."""

import importlib.util
import json
import re
import threading
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
import websockets.sync.server
from tests.service.dashboard.page import (
    SECRETS,
    configuration,
    rig_that_follows_pages,
    serving,
)
from tests.typescript.package import SOURCE, package, run
from websockets.sync.server import ServerConnection

from frictus.protocol import EXAMPLE_FRAME

pytestmark = pytest.mark.timeout(300)  # the first installs, and compiles
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A rig whose finger follows pages, and the API beside it."""
    with rig_that_follows_pages() as router:
        with serving(configuration(router, tmp_path_factory.mktemp("api"), True)) as port:
            yield port


def generator() -> ModuleType:
    path = ROOT / "bench" / "typescript_types.py"
    spec = importlib.util.spec_from_file_location("typescript_types", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_its_types_are_made_from_the_code() -> None:
    kept = (SOURCE / "src" / "messages.ts").read_text(encoding="utf-8")
    assert kept == generator().text(), "uv run python bench/typescript_types.py"


def test_it_has_no_dependency_and_the_version_of_python_s() -> None:
    manifest = json.loads((SOURCE / "package.json").read_text(encoding="utf-8"))
    assert "dependencies" not in manifest
    assert manifest["license"] == "BSD-3-Clause"
    assert all(version[0].isdigit() for version in manifest["devDependencies"].values())


def test_its_tests_run_without_a_service() -> None:
    told = run("npm", "test", folder=package())
    assert "FRICTUS_URL names no service" in told


@pytest.mark.long
def test_it_works_in_node(port: int) -> None:
    told = run(
        "npm",
        "test",
        folder=package(),
        FRICTUS_URL=f"ws://127.0.0.1:{port}",
        FRICTUS_TOKEN=SECRETS["render"],
    )
    assert "# fail 0" in told
    assert "# skipped 0" in told
    assert int(told.split("# pass ")[1].split()[0]) >= 8
    update = bytes.fromhex(told.split("update ")[1].split()[0])
    assert update == EXAMPLE_FRAME.pack()


def test_it_is_packed_and_installed(port: int, tmp_path: Path) -> None:
    told = json.loads(run("npm", "pack", "--json", "--ignore-scripts", folder=package()))[0]
    names = {entry["path"] for entry in told["files"]}
    assert {"package.json", "README.md", "build/src/index.js", "build/src/index.d.ts"} <= names
    assert not [name for name in names if "test" in name or "example" in name]
    assert told["unpackedSize"] < 200_000
    (tmp_path / "package.json").write_text('{"type": "module", "private": true}')
    archive = str(package() / told["filename"])
    quiet = ("--no-audit", "--no-fund", "--offline", "--no-package-lock")
    run("npm", "install", *quiet, archive, folder=tmp_path)
    # The example of its README, as somebody would paste it.
    readme = (SOURCE / "README.md").read_text(encoding="utf-8")
    example = readme.split("```ts\n")[1].split("```")[0]
    example = example.replace("8420", str(port)).replace("…", SECRETS["render"])
    (tmp_path / "example.mjs").write_text(example, encoding="utf-8")
    told = run("node", "--experimental-websocket", "example.mjs", folder=tmp_path)
    assert "force" in told


@pytest.mark.long
def test_its_figures_can_be_measured(port: int) -> None:
    told = run(
        "node",
        "--experimental-websocket",
        "build/bench/measure.js",
        folder=package(),
        FRICTUS_URL=f"ws://127.0.0.1:{port}",
        FRICTUS_TOKEN=SECRETS["read"],
        FRICTUS_SECONDS="2",
    )
    figures = json.loads(told)
    assert figures["samples"] > 2 * 2 * 10_000
    assert figures["states"] > 200


WELCOME = json.dumps({"op": "welcome", "protocol": "1.1", "client": "x", "utc_us": 1})
LISTEN = """
import { connect } from "./build/src/index.js";
try {
  const client = await connect(process.argv[2]);
  console.log("closed:", await client.closed);
} catch (error) {
  console.log(`${error.constructor.name}:`, error.message);
}
"""


@pytest.mark.parametrize(
    ("sent", "why"),
    [
        (["{"], "ClosedError: .* sent no JSON"),
        ([b"binary"], "ClosedError: .* sent no JSON"),
        (['{"op": "rigs"}'], "ClosedError: .* does not welcome"),
        (['{"op": "welcome"}'], "ClosedError: .* speaks 1.0"),
        ([WELCOME, "{"], "closed: .* cannot be read"),
        ([WELCOME, b"short"], "closed: .* cannot be read: 5 bytes"),
        ([WELCOME, b"\x02" + bytes(55)], "closed: .* frame version 2"),
        ([WELCOME], "closed: "),
    ],
)
def test_a_service_that_sends_nonsense_is_left(sent: list[str | bytes], why: str) -> None:
    def serve(connection: ServerConnection) -> None:
        connection.recv()
        for message in sent:
            connection.send(message)

    (package() / "listen.mjs").write_text(LISTEN, encoding="utf-8")
    with websockets.sync.server.serve(serve, "127.0.0.1", 0) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        url = f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        told = run("node", "--experimental-websocket", "listen.mjs", url, folder=package())
        server.shutdown()
        thread.join()
    assert re.match(why, told), told


AT_ONCE = """
import { connect } from "./build/src/index.js";
class AtOnce {
  constructor() {
    setTimeout(() => {
      this.onopen();
      this.onmessage({ data: process.argv[2] });
      this.onmessage({ data: "{" });
      this.onclose({ reason: "" });
    });
  }
  send() {}
  close() {}
}
const client = await connect("ws://127.0.0.1", { WebSocket: AtOnce });
console.log("closed:", await client.closed);
"""


def test_what_comes_together_with_the_end_is_heard() -> None:
    """Else who listens is told of a lost connection, not of what the service said before."""
    (package() / "at_once.mjs").write_text(AT_ONCE, encoding="utf-8")
    told = run("node", "at_once.mjs", WELCOME, folder=package())
    assert re.match("closed: the service sent what cannot be read", told), told
