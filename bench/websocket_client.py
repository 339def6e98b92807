"""What `frictus.websocket` gets of two raw streams and the finger; prints a line of JSON.

Run by `bench/websocket.py`; the same as `measure.ts` of the TypeScript client.
"""

import asyncio
import json
import os
import sys
import time

import numpy as np

from frictus import websocket


async def measure(url: str, seconds: float) -> dict[str, object]:
    """Return losses, ages of the newest sample and state on arrival, and processor time."""
    count = {"samples": 0, "lostSamples": 0, "states": 0, "lostStates": 0}
    ages_ms: dict[str, list[float]] = {"samples": [], "finger": []}

    async def follow(feed: websocket.CountedFeed[websocket.SampleChunk]) -> None:
        async for samples in feed:
            last_ns = samples.utc_ns + 1e9 * (samples.count - 1) / samples.sample_rate_hz
            ages_ms["samples"].append((time.time_ns() - last_ns) / 1e6)
            count["samples"] += samples.count
            count["lostSamples"] += samples.lost

    async def follow_finger(feed: websocket.CountedFeed[websocket.FingerSample]) -> None:
        batch_ns = 0
        async for state in feed:
            count["states"] += 1
            count["lostStates"] += state.lost
            now_ns = time.time_ns()
            if now_ns - batch_ns > 5_000_000:  # the next batch: its newest state counts
                ages_ms["finger"].append(0.0)
            ages_ms["finger"][-1] = (now_ns - state.utc_ns) / 1e6
            batch_ns = now_ns

    async with websocket.connect(url) as client:
        rig = await client.rig("rig1", wait_s=10.0)
        feeds = rig.blocks("force"), rig.blocks("accel")
        fingers = rig.fingers()
        for feed in feeds:
            await anext(feed)
        await anext(fingers)
        began_s = time.process_time()
        tasks = [asyncio.create_task(follow(feed)) for feed in feeds]
        tasks.append(asyncio.create_task(follow_finger(fingers)))
        ended, _ = await asyncio.wait(tasks, timeout=seconds)
        for task in ended:
            task.result()  # none ends but by an error
        used_s = time.process_time() - began_s
        for task in tasks:
            task.cancel()
    quantiles = {
        f"age_{name}_ms": np.quantile(values, [0.5, 0.99, 1.0]).round(2).tolist()
        for name, values in ages_ms.items()
    }
    percent = round(100.0 * used_s / seconds, 1)
    return {"seconds": seconds, **count, **quantiles, "cpu_percent": percent}


if __name__ == "__main__":
    url, seconds = os.environ["FRICTUS_URL"], float(os.environ["FRICTUS_SECONDS"])
    sys.stdout.write(json.dumps(asyncio.run(measure(url, seconds))) + "\n")
