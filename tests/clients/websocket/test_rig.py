"""The client over the WebSocket at a real service and a simulated rig."""

import asyncio
import math
import time
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.dashboard.page import SECRETS

import frictus
from frictus import websocket
from frictus.keys import Topics

PATIENCE_S = 20.0
ROOT = Path(__file__).parents[3]
SCENE = frictus.Scene(
    name="ridges",
    regions=[
        frictus.Region(
            texture=frictus.Profile(friction_n=(0.0, 0.02, 0.0, -0.02), period_mm=2.0)
        )
    ],
)
SINE = 0.04 * np.sin(2.0 * np.pi * np.arange(64) / 64)
Work = Callable[[websocket.AsyncClient], Awaitable[None]]


def run(port: int, work: Work, who: str = "render") -> None:
    async def connected() -> None:
        async with (
            asyncio.timeout(60.0),
            websocket.connect(
                f"ws://127.0.0.1:{port}", SECRETS[who], timeout_s=PATIENCE_S
            ) as client,
        ):
            await work(client)

    asyncio.run(connected())


def test_the_whole_address_will_do_for_rest_too(port: int) -> None:
    async def connected() -> str:
        url = f"ws://127.0.0.1:{port}/v1/live"
        async with websocket.connect(url, SECRETS["read"]) as client:
            return await (await client.rig("rig1", wait_s=PATIENCE_S)).stop()

    assert asyncio.run(connected()) in ("disarmed", "stopping")


def test_two_raw_streams_and_the_finger_without_a_loss(port: int) -> None:
    async def work(client: websocket.AsyncClient) -> None:
        rig = await client.rig("rig1", wait_s=PATIENCE_S)
        assert (client.site, await client.rigs()) == ("lab", ["rig1"])
        force, accel, fingers = rig.blocks("force"), rig.blocks("accel"), rig.fingers()

        async def follow(feed: websocket.CountedFeed[websocket.SampleChunk]) -> int:
            expected, count = None, 0
            async for samples in feed:
                assert samples.data.shape == (3, samples.count)
                if expected is not None:
                    assert samples.first_sample == expected + samples.lost
                expected = samples.first_sample + samples.count
                count += samples.count
                if count > 40_000:
                    break
            assert samples.channels[0] == ("x_n" if feed is force else "x_m_s2")
            assert samples.time_s[-1] == (expected - 1) / 20_000.0  # type: ignore[operator]
            assert frictus.Flag.SIMULATED in samples.flags
            return feed.lost

        async def follow_finger() -> int:
            states = [await anext(fingers) for _ in range(400)]
            steps = np.diff([state.sample for state in states])
            assert steps.tolist() == [100 * (1 + state.lost) for state in states[1:]]
            assert abs(states[-1].utc_ns - time.time_ns()) < 60e9
            span_ns = states[-1].utc_ns - states[0].utc_ns
            assert span_ns == pytest.approx(5e4 * steps.sum(), rel=0.01)  # 50 us a sample
            return fingers.lost

        lost = await asyncio.gather(follow(force), follow(accel), follow_finger())
        assert tuple(lost) == (0, 0, 0)
        status = await rig.status()
        assert (status.rig, status.simulated) == ("rig1", True)
        assert (await rig.scene()).etag == status.scene_etag
        assert (await rig.model()).etag == status.model_etag

    run(port, work, "read")


def test_a_rig_is_taken_changed_streamed_to_and_given_back(port: int) -> None:
    async def work(client: websocket.AsyncClient) -> None:
        rig = await client.rig("rig1")
        with pytest.raises(frictus.RefusedError) as refused:
            async with rig.open_stream(0.05):
                pass
        assert refused.value.code == "not_armed"
        async with rig.arm(lease_ms=10_000) as lease:
            state = await rig.set_scene(SCENE)
            assert state.applied.gain == 1.0
            assert (await rig.status(lambda status: status.scene_etag == state.etag)).owner
            with pytest.raises(frictus.RefusedError, match="another") as conflict:
                await rig.set_scene(SCENE, "another")
            assert conflict.value.code == "conflict"
            async with rig.open_stream(0.05) as stream:
                assert stream.applied.gain > 0.0
                for _ in range(20):
                    await stream.send(SINE, period_mm=2.0, ttl_ms=2_000)
                    await asyncio.sleep(0.005)
            with pytest.raises(frictus.LinkError, match="closed"):
                await stream.send(SINE, period_mm=2.0)
            told = stream.updates
            assert stream.sent == 20
            assert told.sent + told.superseded + told.expired <= 20
            assert told.sent > 0
            assert not lease.lost
        await rig.status(lambda status: status.state == "disarmed")
        async with rig.arm(share_with=["somebody"]):
            shared = await rig.status(lambda status: status.owner == client.name)
            assert shared.share_with == ("somebody",)

    run(port, work)


def test_what_is_out_of_range_never_costs_the_lease(port: int) -> None:
    async def work(client: websocket.AsyncClient) -> None:
        rig = await client.rig("rig1")
        for wrong in (
            {"lease_ms": 100},
            {"share_with": ["no name!"]},
            {"share_with": "bob"},
            {"lease_ms": 1e9},
        ):
            with pytest.raises(frictus.ArgumentError):
                async with rig.arm(**wrong):
                    pass
        async with rig.arm(lease_ms=10_000), rig.open_stream(0.05) as stream:
            of_2_mm = {"period_mm": 2.0}
            for friction, options in [
                (np.full(64, math.nan), of_2_mm),
                (np.full(64, math.inf), of_2_mm),
                (SINE * 2.0, of_2_mm),
                (SINE[:1], of_2_mm),
                (np.zeros(4_097), of_2_mm),
                (np.zeros((2, 2)), of_2_mm),
                ([], of_2_mm),
                (["x", "y"], of_2_mm),
                (SINE, {}),
                (SINE, {"period_mm": 2.0, "period_s": 1.0}),
                (SINE, {"period_mm": math.nan}),
                (SINE, {"period_mm": 1e9}),
                (SINE, {"period_s": 0.0}),
                (SINE, {"period_mm": 2.0, "angle_deg": 361.0}),
                (SINE, {"period_mm": 2.0, "ttl_ms": 0}),
                (SINE, {"period_mm": 2.0, "ttl_ms": 2**40}),
            ]:
                with pytest.raises(frictus.ArgumentError):
                    await stream.send(friction, **options)  # type: ignore[arg-type]
            for point in ((math.nan, 0.0), (1e9, 0.0)):
                with pytest.raises(frictus.ArgumentError):
                    await rig.point(*point)
            with pytest.raises(frictus.ArgumentError):
                await rig.point(1.0, 1.0, normal_force_n=6.0)
            with pytest.raises(frictus.ArgumentError, match="REST"):
                await rig.set_scene(
                    frictus.Profile(friction_n=(0.0, 0.012345678) * 10_000, period_mm=2.0)
                )
            with pytest.raises(frictus.ArgumentError):
                await rig.set_scene(SCENE, "x" * 201)
            await stream.send(SINE, period_mm=2.0, ttl_ms=10_000)
            assert stream.sent == 1
            status = await rig.status(lambda status: status.stream_open)
            assert status.owner == client.name

    run(port, work)


def test_a_lost_lease_ends_the_finger_and_says_who_when_and_why(port: int, router: str) -> None:
    async def work(client: websocket.AsyncClient) -> None:
        rig = await client.rig("rig1")
        async with (
            rig.arm(lease_ms=10_000) as lease,
            rig.open_stream(0.05) as stream,
            rig.blocks("force", timeout_s=PATIENCE_S) as force,
        ):
            fingers = rig.fingers(timeout_s=PATIENCE_S)
            await anext(fingers)
            with frictus.connect(router, "somebody") as other:
                await asyncio.to_thread(other.rig("rig1").stop)
            with pytest.raises(frictus.LeaseLostError, match="'somebody' at ") as lost:
                async for _ in fingers:
                    pass
            assert lost.value.by == "somebody"
            assert abs((lost.value.utc_ns or 0) - time.time_ns()) < 60e9
            assert lease.reason == lost.value.reason
            assert await lease.wait_lost() is lost.value
            with pytest.raises(frictus.LeaseLostError):
                await stream.send(SINE, period_mm=2.0)
            with pytest.raises(frictus.LeaseLostError):
                await anext(rig.fingers())  # it is lost for who comes late, too
            seen = (await anext(force)).first_sample
            async for samples in force:  # what is measured goes on
                if samples.first_sample > seen + 10_000:
                    break
        async with rig.arm():  # and the rig can be taken again
            await anext(rig.fingers(timeout_s=PATIENCE_S))

    run(port, work)


def test_who_may_look_may_stop(port: int) -> None:
    async def work(client: websocket.AsyncClient) -> None:
        rig = await client.rig("rig1")
        async with websocket.connect(f"ws://127.0.0.1:{port}", SECRETS["read"]) as watcher:
            watched = await watcher.rig("rig1")
            async with rig.arm() as lease:
                assert await watched.stop() in ("stopping", "disarmed")
                loss = await lease.wait_lost()
            assert loss.by == watcher.name
            with pytest.raises(frictus.RefusedError) as refused:
                async with watched.arm():
                    pass
            assert refused.value.code == "missing_scope"  # that ends the connection, too
            with pytest.raises(frictus.LinkError, match="missing_scope: this needs the scope"):
                async for _ in watched.fingers(timeout_s=PATIENCE_S):
                    pass

    run(port, work)


def test_leaving_gives_the_rig_back_whatever_happens(port: int) -> None:
    async def work(client: websocket.AsyncClient) -> None:
        rig = await client.rig("rig1")
        stack = AsyncExitStack()
        url = f"ws://127.0.0.1:{port}"
        other = await stack.enter_async_context(websocket.connect(url, SECRETS["render"]))
        await stack.enter_async_context((await other.rig("rig1")).arm())
        await rig.status(lambda status: status.owner == other.name)
        with pytest.raises(frictus.RefusedError) as refused:
            async with rig.arm():
                pass
        assert refused.value.code == "not_owner"
        await stack.aclose()
        await rig.status(lambda status: status.owner is None)
        with pytest.raises(frictus.LinkError, match="closed"):
            async with (await client.rig("rig1")).arm(), (await other.rig("rig1")).arm():
                pass
        with pytest.raises(ZeroDivisionError):
            async with rig.arm():
                raise ZeroDivisionError
        await rig.status(lambda status: status.state == "disarmed")

    run(port, work)


def test_a_client_holds_a_rig_once_and_watches_one(port: int) -> None:
    async def work(client: websocket.AsyncClient) -> None:
        rig = await client.rig("rig1")
        async with rig.arm():
            with pytest.raises(frictus.RefusedError, match="already"):
                async with rig.arm():
                    pass
            assert (await rig.status(lambda status: status.owner == client.name)).state
        with pytest.raises(frictus.NoRigError, match="rig1"):
            await client.rig("another", wait_s=0.0)
        with pytest.raises(frictus.ArgumentError, match="no stream"):
            rig.blocks("sound")  # type: ignore[arg-type]
        with pytest.raises(frictus.ArgumentError, match="not passed on"):
            rig.watch(Topics.TIME)
        async with rig.watch(Topics.FINGER, timeout_s=PATIENCE_S) as states:
            state = await anext(states)
            assert isinstance(state, frictus.FingerState)
            assert state.source == "pointer"
        with pytest.raises(StopAsyncIteration):
            await anext(states)
        async with rig.watch(Topics.ESTIMATE, timeout_s=0.01) as nothing:
            with pytest.raises(frictus.SilenceError):
                await anext(nothing)

    run(port, work)


def test_the_finger_is_moved(port: int) -> None:
    async def work(client: websocket.AsyncClient) -> None:
        rig = await client.rig("rig1")
        async for finger in rig.fingers(timeout_s=PATIENCE_S):
            await rig.point(20.0, 30.0, normal_force_n=1.0)
            if abs(finger.x_mm - 20.0) < 0.5 and abs(finger.y_mm - 30.0) < 0.5:
                break
        assert finger.in_contact

    run(port, work)


def test_the_example_of_the_docs_streams(port: int) -> None:
    text = (ROOT / "docs" / "websocket.md").read_text(encoding="utf-8")
    program = text.split("## Python\n")[1].split("```python\n")[1].split("```")[0]
    assert program.count('8420")') == 1
    program = program.replace('8420")', f'{port}", {SECRETS["render"]!r})')
    names: dict[str, Any] = {}
    exec(program.replace("asyncio.run(main())", ""), names)

    async def work(client: websocket.AsyncClient) -> None:
        rig = await client.rig("rig1")
        before = (await rig.status()).counters.stream_updates
        streaming = asyncio.create_task(names["main"]())
        await rig.status(lambda status: status.counters.stream_updates > before + 2)
        streaming.cancel()
        await asyncio.wait([streaming])
        await rig.status(lambda status: status.state == "disarmed")

    run(port, work)
