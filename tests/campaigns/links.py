"""A client behind a bad link: `python -m tests.campaigns.links --help`.

Its owner streams a texture at 5 Hz, and a reader follows a stream of samples, both through the
link; the device that is driven and the rig are on the near side of it.
"""

import contextlib
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np
from tests.campaigns.hosted import await_driven, silent_after_ms
from tests.campaigns.lines import Line, asked, go_on
from tests.campaigns.owner import UPDATE_S, own
from tests.campaigns.proxy import Impairment, Proxy
from tests.campaigns.service import START_S, Said, config_in, serving

import frictus
from frictus.errors import FrictusError
from frictus_hardware import SimulatedConfig, SimulatedDeviceConfig
from frictus_hardware.simulated.device_rig import launched
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import Config, Limits

LEASE_MS: Final = 1_000
LATE_MS: Final = 100.0
LEAD_MS: Final = 100.0
LIMITS: Final = Limits(freeze_ms=500, missed_deadlines=1_000)
"""With these it is the link that fails here; a machine that is too busy even so may trip it."""
WATCHED_S: Final = 8.0
SETTLING_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class Condition:
    """What a link is like, and what happens to it once.

    Attributes
    ----------
    impairment : Impairment
    event : "stall", "cut" or None
    lasting_s : float
        How long the event lasts.
    """

    impairment: Impairment
    event: Literal["stall", "cut"] | None = None
    lasting_s: float = 0.0

    @property
    def ends_the_lease(self) -> bool:
        """Whether no renewal can reach the rig in time."""
        return self.lasting_s > 1e-3 * LEASE_MS


CONDITIONS: Final = {
    "as it is": Condition(Impairment()),
    **{
        f"delay {1e3 * delay_s:g} ms": Condition(Impairment(delay_s))
        for delay_s in (0.005, 0.02, 0.1, 0.2)
    },
    "delay 20 ms, jitter 50 ms": Condition(Impairment(0.02, 0.05)),
    **{
        f"delay 20 ms, loss {100.0 * loss:g} %": Condition(Impairment(0.02, loss=loss))
        for loss in (0.0001, 0.001, 0.01)
    },
    "100 kB/s": Condition(Impairment(rate_bytes_s=1e5)),
    **{
        f"stall of {lasting_s:g} s": Condition(Impairment(0.005), "stall", lasting_s)
        for lasting_s in (0.5, 2.0, 10.0)
    },
    **{
        f"cut for {lasting_s:g} s": Condition(Impairment(0.005), "cut", lasting_s)
        for lasting_s in (2.0, 10.0)
    },
}


class EndedError(Exception):
    """Told to end."""


class Owner:
    """Holds the rig through an endpoint until the context ends."""

    def __init__(self, endpoint: str) -> None:
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._own, args=(endpoint,))

    def _own(self, endpoint: str) -> None:
        def pause() -> None:
            if self._ending.wait(UPDATE_S):
                raise EndedError

        with contextlib.suppress(EndedError):
            own(endpoint, LEASE_MS, pause)

    def __enter__(self) -> None:
        """Begin."""
        self._thread.start()

    def __exit__(self, *_error: object) -> None:
        """End."""
        self._ending.set()
        self._thread.join()


@dataclass(frozen=True, slots=True)
class Followed:
    """What a reader got of a stream.

    Attributes
    ----------
    blocks, missing : int
    age_ms : tuple of float
        Median and 99th percentile of the newest sample's age as a block is read.
    """

    blocks: int
    missing: int
    age_ms: tuple[float, float]


def follow(endpoint: str, seconds: float) -> Followed:
    """Read a stream of samples for so long."""
    ages_ms, missing = [], 0
    with frictus.connect(endpoint, name="reader", patient=True) as client:
        with client.rig("rig1").blocks("force", timeout_s=START_S) as feed:
            began_s = None
            for item in feed:
                if isinstance(item, frictus.Gap):
                    missing += item.missing_blocks
                    continue
                now_s = time.monotonic()
                began_s = began_s or now_s
                if now_s > began_s + seconds:
                    break
                last_ns = item.utc_ns + 1e9 * item.data.shape[1] / item.sample_rate_hz
                ages_ms.append(1e-6 * (time.time_ns() - last_ns))
    median_ms, high_ms = np.percentile(ages_ms, (50.0, 99.0)).tolist()
    return Followed(len(ages_ms), missing, (round(median_ms, 1), round(high_ms, 1)))


class Campaign:
    """One service and its device, for all conditions."""

    def __init__(self) -> None:
        self._stack = contextlib.ExitStack()
        self._site: tuple[Config, SimulatedDeviceConfig, Said] | None = None

    def _started(self) -> tuple[Config, SimulatedDeviceConfig, Said]:
        if self._site is None:
            folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
            device = self._stack.enter_context(
                launched(SimulatedConfig(finger=SteadyStrokes(), lead_ms=LEAD_MS))
            )
            config = config_in(folder, device).model_copy(update={"limits": LIMITS})
            said = Said()
            self._stack.enter_context(serving(config, said, ("rig",)))
            self._site = config, device, said
        return self._site

    def run(self, name: str, seed: int) -> Line:
        """Return the line of a condition; a service that is lost over it is made anew."""
        condition = CONDITIONS[name.rsplit("/", 1)[0]]
        try:
            return self._tried(condition, seed)
        except (FrictusError, OSError, TimeoutError) as error:
            self.close()
            return {"failures": [{"what": f"{type(error).__name__}: {error}"}]}

    def _tried(self, condition: Condition, seed: int) -> Line:
        config, device, said = self._started()
        port = int(config.router.endpoint.rsplit(":", 1)[1])
        said.new_ends()
        began_s = time.monotonic()
        line: Line
        with (
            frictus.connect(config.router.endpoint, name="witness") as client,
            Proxy(port, condition.impairment, seed) as proxy,
            Owner(f"tcp/127.0.0.1:{proxy.port}"),
        ):
            rig = client.rig(config.rig, config.site)
            wrong = [] if await_driven(device, START_S) else ["nothing is driven"]
            before = rig.status().counters
            if condition.event is None:
                line = self._watched(rig, f"tcp/127.0.0.1:{proxy.port}")
                if line["missing"] and condition.impairment.rate_bytes_s == float("inf"):
                    wrong.append(f"{line['missing']} blocks of {line['blocks']} are missing")
                if line["lease_lost"] and not condition.impairment.loss:
                    wrong.append("the lease was lost")
            else:
                line = self._broken(proxy, condition, device)
                bound_ms = LEASE_MS + LEAD_MS + LATE_MS
                if condition.ends_the_lease and not line["zero_ms"] <= bound_ms:
                    wrong.append(f"zero after {line['zero_ms']:.0f} ms")
                if not line["driven_again"]:
                    wrong.append("nothing is driven afterwards")
            after = rig.status().counters
            late = after.deadline_misses - before.deadline_misses
            if after.trips != before.trips and late < LIMITS.missed_deadlines:
                wrong.append("the rig tripped")
        wrong += said.new_ends()
        seconds = round(time.monotonic() - began_s, 1)
        return line | {"seconds": seconds, "failures": [{"what": what} for what in wrong]}

    def _watched(self, rig: frictus.Rig, endpoint: str) -> Line:
        """Read through a link that stays as it is."""
        before = rig.status()
        began_s = time.monotonic()
        followed = follow(endpoint, WATCHED_S)
        seconds = time.monotonic() - began_s
        after = rig.status()
        updates = after.counters.stream_updates - before.counters.stream_updates
        return {
            "blocks": followed.blocks,
            "missing": followed.missing,
            "age_ms": followed.age_ms,
            "updates_hz": round(updates / seconds, 2),
            "lease_lost": after.last_end != before.last_end,
        }

    def _broken(
        self, proxy: Proxy, condition: Condition, device: SimulatedDeviceConfig
    ) -> Line:
        """Have a link break for a while."""
        pause = threading.Event()  # never set
        pause.wait(SETTLING_S)
        hit_s = time.monotonic()
        (proxy.stall if condition.event == "stall" else proxy.cut)()
        zero_ms = None
        if condition.ends_the_lease:
            zero_ms = silent_after_ms(device, hit_s, 1e-3 * LEASE_MS + 5.0)
        pause.wait(max(0.0, hit_s + condition.lasting_s - time.monotonic()))
        proxy.mend()
        mended_s = time.monotonic()
        driven = await_driven(device, START_S)
        return {
            "zero_ms": zero_ms,
            "driven_again": driven,
            "again_s": round(time.monotonic() - mended_s, 2),
        }

    def close(self) -> None:
        """End the service."""
        self._site = None
        self._stack.close()


def names(repeats: int) -> list[str]:
    """Return the names of all batches."""
    return [f"{name}/{number}" for number in range(repeats) for name in CONDITIONS]


def main() -> None:
    """Run the campaign, or a part of it."""
    wanted = asked(__doc__, "repeats", 3, "of each condition", names)
    with contextlib.closing(Campaign()) as campaign:
        for line in go_on(*wanted, campaign.run):
            print(line, flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
