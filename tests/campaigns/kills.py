"""Random kill -9 and SIGSTOP, one or two at once: `python -m tests.campaigns.kills --help`.

A service of processes runs under load: an owner streams a texture at 5 Hz, everything is
recorded, models are published. Whatever is killed or frozen, the screen must be at zero within
the bound, what was acknowledged must still be there, and the service must drive again.
"""

import contextlib
import json
import random
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tests.campaigns.hosted import (
    LEASE_MS,
    Hosted,
    Spawned,
    await_driven,
    owner,
    send,
    silent_after_ms,
)
from tests.campaigns.lines import Line, asked, go_on
from tests.campaigns.service import START_S, config_in, http_status, publish

import frictus
from frictus.errors import FrictusError
from frictus_hardware import SimulatedConfig, SimulatedDeviceConfig
from frictus_hardware.simulated.device_rig import launched
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.errors import RecordingError
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.summary import summarise

PARTS: Final = ("rig", "api", "recorder", "tracker")
TARGETS: Final = ("client", *PARTS, "supervisor")
SILENCING: Final = ("client", "rig", "supervisor")
"""After whose end nobody drives; the supervisor's takes the router with it."""
SIGNALS: Final = ("SIGKILL", "SIGSTOP")
FROZEN_S: Final = 1.5
"""For how long what is frozen stays so; a frozen rig is killed before."""
LATE_MS: Final = 100.0
"""Beyond lease and freeze limit, as `docs/safety.md` states for a rig in time."""
LOST_S: Final = 1.5
"""Of a recording: a second between syncs, and the recorder's beat."""
TOLD_S: Final = 10.0
"""Within which a supervisor, once it goes on itself, has told of an end."""
PUBLISH_S: Final = 0.05


@dataclass(frozen=True, slots=True)
class Attack:
    """Whom what is sent to, at once."""

    signals: dict[str, str]

    @classmethod
    def draw(cls, rng: random.Random) -> "Attack":
        """Return one or two targets; supervisor and rig at once are left to the interlock."""
        while True:
            targets = rng.sample(TARGETS, rng.choice([1, 1, 2]))
            if not {"rig", "supervisor"} <= set(targets):
                return cls({target: rng.choice(SIGNALS) for target in targets})

    def __str__(self) -> str:
        """Return it in words."""
        return " + ".join(f"{target} {name}" for target, name in self.signals.items())

    @property
    def silences(self) -> bool:
        """Whether nothing may be driven after it."""
        return any(target in SILENCING for target in self.signals)


@dataclass
class Site:
    """A service under load that is attacked again and again."""

    hosted: Hosted
    device: SimulatedDeviceConfig
    owner: Spawned
    published: list[str] = field(default_factory=list)
    """Models that the API has acknowledged since the last attack."""
    recordings: int = 0

    def attack(self, attack: Attack, delay_s: float) -> Line:
        """Attack once; return what came of it.

        Parameters
        ----------
        attack : Attack
        delay_s : float
            After everything runs, so that it hits any moment.
        """
        began_s = time.monotonic()
        failures: list[dict[str, str]] = []
        if not await_driven(self.device, START_S):
            failures.append({"what": "before the attack: nothing is driven"})
        name, recorded_s = self._record()
        self.published.clear()
        due_s = time.monotonic() + delay_s
        while time.monotonic() < due_s:
            self._publish()
            time.sleep(PUBLISH_S)
        await_driven(self.device, START_S)  # a busy machine may have stopped it since
        pids = {
            target: self.owner.pid if target == "client" else self.hosted.pid(target)
            for target in (*TARGETS,)
        }
        self.hosted.said.new_ends()
        hit_s = time.monotonic()
        for target, signal in attack.signals.items():
            send(pids[target], signal)
        bound_ms = LEASE_MS + self.hosted.config.limits.freeze_ms + LATE_MS
        zero_ms = None
        if attack.silences:
            zero_ms = silent_after_ms(self.device, hit_s, 1e-3 * bound_ms + 5.0)
            if not zero_ms <= bound_ms:
                failures.append({"what": f"{attack}: zero after {zero_ms:.0f} ms"})
        self._recover(attack, pids, hit_s, failures)
        if not await_driven(self.device, START_S):
            failures.append({"what": f"{attack}: nothing is driven afterwards"})
        again_s = time.monotonic() - hit_s
        failures += [
            {"what": f"{attack}: {lost}"} for lost in self._lost(name, hit_s - recorded_s)
        ]
        return {
            "attack": str(attack),
            "zero_ms": zero_ms,
            "again_s": round(again_s, 2),
            "published": len(self.published),
            "seconds": round(time.monotonic() - began_s, 2),
            "failures": failures,
        }

    def _recover(
        self, attack: Attack, pids: dict[str, int], hit_s: float, failures: list[dict[str, str]]
    ) -> None:
        """Let the frozen go on, and start what nobody starts again."""
        frozen = [target for target, name in attack.signals.items() if name == "SIGSTOP"]
        time.sleep(max(0.0, hit_s + FROZEN_S - time.monotonic()) if frozen else 0.0)
        for target in frozen:
            send(pids[target], "SIGCONT")
        # A rig that stands still is ended; the others go on where they were.
        ends = attack.signals.get("rig") or "SIGKILL" in [
            attack.signals.get(part) for part in PARTS
        ]
        if attack.signals.get("supervisor") == "SIGKILL":
            parts = [pids[target] for target in PARTS]
            left = self.hosted.end_with(parts)
            if left:
                failures.append(
                    {"what": f"{attack}: {len(left)} parts outlived the supervisor"}
                )
            self.hosted.start()
        elif ends and not self.hosted.said.await_end(TOLD_S):
            failures.append({"what": f"{attack}: nobody noticed"})
        elif not self.hosted.said.await_recovery():
            failures.append({"what": f"{attack}: {self.hosted.said.lines[-3:]}"})
        if attack.signals.get("client") == "SIGKILL":
            self.owner.kill()
            self.owner = Spawned(owner, self.hosted.config.router.endpoint)

    def _record(self) -> tuple[str, float]:
        """Begin a recording; return its name and when it was acknowledged."""
        config = self.hosted.config
        self.recordings += 1
        name = f"kill-{self.recordings}"
        with frictus.connect(config.router.endpoint, name="witness") as client:
            rig = client.rig(config.rig, config.site)
            with contextlib.suppress(FrictusError):
                rig.end_recording()
            rig.record(name)
        return name, time.monotonic()

    def _publish(self) -> None:
        """Publish a model; remember it if that was acknowledged."""
        status, reference = publish(self.hosted.config)
        if status == 201:
            self.published.append(reference)

    def _lost(self, recording: str, recorded_s: float) -> list[str]:
        """Return what was acknowledged and is no longer there."""
        lost = []
        for reference in self.published:
            status = http_status(self.hosted.config, f"/v1/models/{reference}")
            if status != 200:
                lost.append(f"model {reference}: {status}")
        path = self.hosted.config.recordings / f"{recording}.mcap"
        try:
            with RecordingReader(path) as reader:
                ending = summarise(reader).ending
            if ending.clean_s < recorded_s - LOST_S:
                lost.append(f"{recorded_s:.1f} s had been recorded; {ending}")
        except (OSError, RecordingError) as error:
            if recorded_s > LOST_S:
                lost.append(f"{recording}: {error}")
        return lost


@contextlib.contextmanager
def site(folder: Path) -> Iterator[Site]:
    """Run a service under load until the context ends."""
    with launched(SimulatedConfig(finger=SteadyStrokes())) as config:
        hosted = Hosted(config_in(folder, config))
        hosted.start()
        made = Site(hosted, config, Spawned(owner, hosted.config.router.endpoint))
        try:
            yield made
        finally:
            made.owner.end()
            hosted.end()


class Campaign:
    """Attacks one site, and takes a new one where an attack has left it unusable."""

    def __init__(self) -> None:
        self._stack = contextlib.ExitStack()
        self._site: Site | None = None

    def run(self, _name: str, seed: int) -> Line:
        """Return the line of an attack."""
        rng = random.Random(seed)
        attack, delay_s = Attack.draw(rng), rng.uniform(0.0, 2.0)
        try:
            if self._site is None:
                folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
                self._site = self._stack.enter_context(site(folder))
            return self._site.attack(attack, delay_s)
        except (FrictusError, OSError, TimeoutError) as error:
            self.close()
            what = f"{attack}: {type(error).__name__}: {error}"
            return {"attack": str(attack), "failures": [{"what": what}]}

    def close(self) -> None:
        """End the site."""
        self._site = None
        self._stack.close()


def names(attacks: int) -> list[str]:
    """Return the names of all attacks."""
    return [f"kill/{number}" for number in range(attacks)]


def main() -> None:
    """Run the campaign, or a part of it."""
    wanted = asked(__doc__, "attacks", 200, "how many", names)
    campaign = Campaign()
    with contextlib.closing(campaign):
        for line in go_on(*wanted, campaign.run):
            told = {key: line.get(key) for key in ("attack", "zero_ms", "again_s", "failures")}
            print(line["name"], line["seed"], json.dumps(told), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
