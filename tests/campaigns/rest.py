"""Requests drawn from the reference, to every path: `python -m tests.campaigns.rest --help`.

A whole service runs. schemathesis, with all its checks, sends what `/openapi.json` allows and
what it forbids, without a token and with one of each scope; then come clients that harm by how
they send and read (`hostile_clients.py`). Nothing may be answered with a status that is not
documented, nor with 5xx but a typed 503 or 504; no process may end and no rig trip.
"""

import contextlib
import json
import re
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from prometheus_client.parser import text_string_to_metric_families
from tests.campaigns import hostile_clients
from tests.campaigns.lines import Line, asked, go_on
from tests.campaigns.service import Said, config_in, http_status, publish, serving

import frictus
from frictus.errors import FrictusError
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import ApiConfig, Config, Scope, Token
from frictus_service.processes import free_port

SCOPES: Final[dict[str, tuple[Scope, ...]]] = {
    "none": (),
    "read": ("read",),
    "render": ("render",),
    "calibrate": ("calibrate",),
    "admin": ("admin",),
    "all": ("read", "render", "calibrate", "admin"),
}
LEAST: Final = 2_000
"""A batch of a scope sends at least so many requests: the coverage phase of schemathesis."""
EXAMPLES: Final = 20
"""Drawn for each path and method, besides."""
ANSWER_S: Final = 10.0
"""Longest time of an answer, on a machine that does nothing else."""
CHECKS: Final = """\
[generation]
database = "none"

# Typed, and no fault of the server: `no_link`, `busy` and others; `outcome_unknown`.
[checks.not_a_server_error]
expected-statuses = ["2xx", "3xx", "4xx", "503", "504"]

# What stands there now decides over 412, and what a caller saw over 428.
[checks.positive_data_acceptance]
expected-statuses = [
  "2xx", "3xx", "401", "403", "404", "409", "412", "428", "429", "503", "504",
]

[checks.negative_data_rejection]
expected-statuses = ["4xx", "503"]

[checks.missing_required_header]
expected-statuses = ["400", "401", "403", "406", "415", "422", "428"]

# Bodies have rules between fields (one of two, from < to), which JSON Schema does not state.
[[operations]]
include-method = ["POST", "PUT"]
[operations.checks.positive_data_acceptance]
expected-statuses = [
  "2xx", "3xx", "401", "403", "404", "409", "412", "422", "428", "429", "503", "504",
]

# For their ETags schemathesis draws "0" or nothing, too, which the stated pattern excludes.
[[operations]]
include-name = ["GET /v1/textures/{name}", "DELETE /v1/textures/{name}"]
[operations.checks.positive_data_acceptance]
expected-statuses = [
  "2xx", "3xx", "401", "403", "404", "409", "412", "422", "428", "429", "503", "504",
]

# DELETE cancels a job, with 202; its record stays.
[[operations]]
include-path-regex = "^/v1/(calibrations|discoveries)/"
[operations.checks.use_after_free]
enabled = false
"""


def token_of(scope: str) -> str:
    """Return the token of a key of `SCOPES`."""
    return f"the-token-of-{scope}"


class Bench:
    """A service with a token for each scope, and a model in its registry."""

    def __init__(self, folder: Path) -> None:
        tokens = tuple(
            Token(name=name, scopes=scopes, value=token_of(name))
            for name, scopes in SCOPES.items()
            if scopes
        )
        backend = SimulatedConfig(finger=SteadyStrokes())
        # One address sends all; how many it may is not what is looked at.
        api = ApiConfig(port=free_port(), tokens=tokens, max_requests_per_s=1e5)
        self.config: Config = config_in(folder, backend).model_copy(update={"api": api})
        self.said = Said()

    @contextlib.contextmanager
    def running(self) -> Iterator["Bench"]:
        """Run the service."""
        with (
            serving(self.config, self.said),
            frictus.connect(self.config.router.endpoint, name="campaign") as client,
        ):
            self.rig = client.rig(self.config.rig, self.config.site)
            publish(self.config, token_of("all"))
            yield self

    def faults(self) -> list[str]:
        """Return what is wrong with the service now."""
        found = [
            f"the API answers {path} with {status}"
            for path in ("/v1/health", "/v1/ready")
            if (status := http_status(self.config, path)) != 200
        ]
        try:
            state = self.rig.status().state
        except FrictusError as error:
            return [*found, f"the rig does not answer: {error}"]
        if state == "tripped":
            found.append(f"the rig tripped: {self.rig.status().fault}")
            self.rig.reset()
        return found

    def answered(self) -> Counter[str]:
        """Return how many requests the API has answered, by status."""
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.config.api.port}/metrics",
            headers={"Authorization": f"Bearer {token_of('read')}"},
        )
        with urllib.request.urlopen(request, timeout=60.0) as answer:
            text = answer.read().decode()
        counted = Counter[str]()
        for family in text_string_to_metric_families(text):
            if family.name == "frictus_api_requests":
                for sample in family.samples:
                    if sample.name.endswith("_total"):
                        counted[sample.labels["status"]] += int(sample.value)
        return counted


def drawn(
    bench: Bench, scope: str, seed: int, phases: str, examples: int, answer_s: float = ANSWER_S
) -> Line:
    """Return the line of a batch of schemathesis.

    Parameters
    ----------
    bench : Bench
    scope : str
        A key of `SCOPES`.
    seed : int
    phases : str
        Of ``examples``, ``coverage``, ``fuzzing``, ``stateful``, with commas.
    examples : int
        Requests drawn for each path and method.
    answer_s : float
        Longest time of an answer.
    """
    before = bench.answered()
    with tempfile.TemporaryDirectory() as folder:
        checks, report = Path(folder, "checks.toml"), Path(folder, "report.json")
        checks.write_text(CHECKS, encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "schemathesis.cli",
            "--config-file",
            str(checks),
            "run",
        ]
        command += [f"http://127.0.0.1:{bench.config.api.port}/openapi.json"]
        command += ["--phases", phases, "--max-examples", str(examples), "--seed", str(seed)]
        command += ["--max-response-time", str(answer_s), "--no-shrink", "--no-color"]
        command += ["--request-timeout", str(answer_s)]
        command += ["--continue-on-failure", "--report-json-path", str(report)]
        if SCOPES[scope]:
            command += ["--header", f"Authorization: Bearer {token_of(scope)}"]
        ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if not report.exists():
            raise RuntimeError(f"schemathesis: {ended.stdout[-500:]} {ended.stderr[-500:]}")
        said: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))
    failures = [
        {"what": f"{one['title']}: {', '.join(one['operations'])}"} for one in said["failures"]
    ]
    failures += [{"what": f"schemathesis: {one}"} for one in said["errors"]]
    line: Line = {"cases": said["test_cases"]["generated"], "failures": failures}
    if failures:
        line["report"] = re.sub(r"\n{3,}", "\n\n", ended.stdout)[-20_000:]
    return line | {"outcomes": dict(bench.answered() - before)}


def batches(cases: int) -> list[str]:
    """Return the names of the batches that together send at least so many requests."""
    rounds = -(-cases // (LEAST * len(SCOPES)))
    drawn = [f"{scope}/{number}" for number in range(rounds) for scope in SCOPES]
    return [*drawn, *(f"hostile/{name}" for name in hostile_clients.KINDS)]


class Campaign:
    """Runs batches beside one service; a context manager."""

    def __enter__(self) -> "Campaign":
        """Start the service."""
        self._stack = contextlib.ExitStack()
        folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
        self._bench = self._stack.enter_context(Bench(folder).running())
        return self

    def __exit__(self, *_error: object) -> None:
        """End it."""
        self._stack.close()

    def run(self, name: str, seed: int) -> Line:
        """Return the line of a batch."""
        bench, (scope, which) = self._bench, name.split("/")
        began_s = time.monotonic()
        if scope == "hostile":
            line = hostile_clients.run(
                which, bench.config.api.port, bench.said.pid("api"), token_of("all")
            )
        else:
            line = drawn(bench, scope, seed, "examples,coverage,fuzzing,stateful", EXAMPLES)
        line["failures"] += [{"what": what} for what in bench.faults()]
        line["failures"] += [{"what": what} for what in bench.said.new_ends()]
        return line | {"seconds": round(time.monotonic() - began_s, 1)}


def main() -> None:
    """Run the campaign, or a part of it."""
    wanted = asked(__doc__, "cases", 10_000, "requests, at least", batches)
    with Campaign() as campaign:
        for line in go_on(*wanted, campaign.run):
            told = [failure["what"][:160] for failure in line["failures"]]
            head = f"{line['name']} seed {line['seed']}: {line['cases']} {line['outcomes']}"
            print(head, *told, sep="\n  ", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
