"""What runs on a host: asked by lines on standard input, answers by lines of JSON.

`python member.py owner ENDPOINT RIG LEASE_MS`, `watcher ENDPOINT RIG...`, `gauge ADDRESS`.
"""

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import frictus
from frictus.errors import FrictusError
from frictus.gaps import BlockFeed
from frictus.keys import Topics
from frictus_hardware import SimulatedDeviceConfig
from frictus_hardware.simulated.device_rig import recent_output

WAIT_S = 60.0
QUIET_SAMPLES = 10_000
TEXTURE = frictus.Spectrum(components=[frictus.Component(amplitude_n=0.08, cycles_per_mm=1.0)])


class Owner:
    """Holds a rig; the clock of its host can be set."""

    def __init__(self, endpoint: str, rig: str, lease_ms: str) -> None:
        self._rig_name, self._lease_ms = rig, int(lease_ms)
        self._client = frictus.connect(endpoint, name="owner")
        self._lease: frictus.Lease | None = None
        self._ahead_ns = 0
        true_ns = time.time_ns
        time.time_ns = lambda: true_ns() + self._ahead_ns

    def arm(self) -> dict[str, Any]:
        """Take the rig, once it is there, unless it is held."""
        if self._lease is not None and not self._lease.lost:
            return {"armed": True}
        rig = self._client.rig(self._rig_name, wait_s=WAIT_S)
        if self._lease is not None:
            self._lease.disarm()
        if rig.status().state == "tripped":
            rig.reset()  # late on a busy machine: nothing that these tests are about
        rig.set_scene(TEXTURE)
        self._lease = rig.arm(self._lease_ms)
        return {"armed": True}

    def wait_lost(self) -> dict[str, Any]:
        """Wait until the lease is lost."""
        assert self._lease is not None
        return {"lost": self._lease.wait_lost(WAIT_S), "reason": self._lease.reason}

    def set_clock(self, ahead_s: str) -> dict[str, Any]:
        """Have the clock of this host jump."""
        self._ahead_ns = int(1e9 * float(ahead_s))
        return {"ahead_s": float(ahead_s)}


class Watcher:
    """Follows rigs from afar, and counts what it misses."""

    def __init__(self, endpoint: str, *rigs: str) -> None:
        client = frictus.connect(endpoint, name="watcher")
        self._rigs = {name: client.rig(name, wait_s=WAIT_S) for name in rigs}
        # So long that only the network can lose something.
        self._feeds = {
            name: rig.blocks("voltage", capacity=100_000, timeout_s=WAIT_S)
            for name, rig in self._rigs.items()
        }
        self._seen = {name: Seen(feed) for name, feed in self._feeds.items()}

    def until(self, rig: str, what: str) -> dict[str, Any]:
        """Read a stream until it is `driven`, `quiet`, or has a `gap`."""
        return self._seen[rig].until(what)

    def until_now(self, rig: str) -> dict[str, Any]:
        """Read a stream up to a block made after this call."""
        return self._seen[rig].until_utc(time.time_ns())

    def status(self, rig: str, state: str) -> dict[str, Any]:
        """Wait for a state of a rig, and return its status."""
        with self._rigs[rig].watch(Topics.STATUS, timeout_s=WAIT_S) as states:
            for status in states:
                assert isinstance(status, frictus.RigStatus)
                if status.state == state:
                    return status.model_dump(mode="json")
        raise AssertionError("the feed has ended")


class Seen:
    """What was seen of one stream."""

    def __init__(self, feed: BlockFeed) -> None:
        self._feed = feed
        self._first: frictus.Block | None = None
        self._last: frictus.Block | None = None
        self._gaps: list[frictus.Gap] = []
        self._driven_sample = self._armed_sample = 0

    def until(self, what: str) -> dict[str, Any]:
        gaps = len(self._gaps)
        reached: dict[str, Callable[[frictus.Block], bool]] = {
            "driven": lambda block: bool(block.data.any()),
            "quiet": lambda block: (
                block.first_sample
                > max(self._driven_sample, self._armed_sample) + QUIET_SAMPLES
            ),
            "gap": lambda _block: len(self._gaps) > gaps,
        }
        return self._read(reached[what])

    def until_utc(self, utc_ns: int) -> dict[str, Any]:
        return self._read(lambda block: block.utc_ns > utc_ns)

    def _read(self, enough: Callable[[frictus.Block], bool]) -> dict[str, Any]:
        for item in self._feed:
            if isinstance(item, frictus.Gap):
                self._gaps.append(item)
                continue
            self._note(item)
            if enough(item):
                return self._tally()
        raise AssertionError("the feed has ended")

    def _note(self, block: frictus.Block) -> None:
        self._first = self._first or block
        self._last = block
        (places,) = np.nonzero(block.data[0])
        if places.size:
            self._driven_sample = block.first_sample + int(places[-1])
        if block.flags & frictus.Flag.ARMED:
            self._armed_sample = block.first_sample + block.data.shape[1]

    def _tally(self) -> dict[str, Any]:
        assert self._first is not None
        assert self._last is not None
        return {
            "same_run": self._first.run == self._last.run,
            "made": self._last.sequence - self._first.sequence + 1,
            "received": self._feed.received,
            "lost": self._feed.lost,
            "gaps": [[gap.reason, gap.missing_blocks, gap.samples] for gap in self._gaps],
            "driven_sample": self._driven_sample,
            "armed_sample": self._armed_sample,
            "block_samples": self._last.data.shape[1],
        }


class Gauge:
    """Reads the output of a rig's device, on the rig's own host."""

    def __init__(self, address: str) -> None:
        self._config = SimulatedDeviceConfig(address=address)

    def output(self, seconds: str) -> dict[str, Any]:
        """Return what the device has output lately."""
        output = recent_output(self._config, float(seconds))
        (places,) = np.nonzero(output.voltage_v)
        return {
            "armed": output.armed,
            "now_sample": output.first_sample + output.voltage_v.size,
            "driven_sample": output.first_sample + int(places[-1] if places.size else 0),
        }


def main() -> None:
    """Answer until nobody asks any more."""
    kinds: dict[str, Callable[..., Any]] = {"owner": Owner, "watcher": Watcher, "gauge": Gauge}
    member = kinds[sys.argv[1]](*sys.argv[2:])
    _say({"ready": True})
    for line in sys.stdin:
        name, *arguments = line.split()
        try:
            _say(getattr(member, name)(*arguments))
        except (FrictusError, OSError, LookupError) as error:
            _say({"error": str(error)})


def _say(answer: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
