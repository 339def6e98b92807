"""The client over the WebSocket of the API, for machines where Zenoh's port is closed.

>>> import asyncio
>>> from frictus import Profile, websocket
>>> async def main() -> None:
...     async with websocket.connect("ws://127.0.0.1:8420") as client:
...         rig = await client.rig("rig1")
...         async with rig.arm():
...             await rig.set_scene(Profile(friction_n=(0.0, 0.02, 0.0, -0.02), period_mm=2.0))
...             async for finger in rig.fingers():
...                 print(finger.x_mm, finger.vx_mm_s)

Names, errors and types are those of `frictus`, with `Async` before classes whose methods are
awaited. It needs the package websockets: ``pip install 'frictus[websocket]'``.
"""

from frictus.websocket.client import DEFAULT_URL, AsyncClient, connect
from frictus.websocket.feeds import AsyncFeed, CountedFeed, FingerSample, SampleChunk
from frictus.websocket.held import AsyncLease, AsyncTextureStream
from frictus.websocket.rig import AsyncRig

__all__ = [
    "DEFAULT_URL",
    "AsyncClient",
    "AsyncFeed",
    "AsyncLease",
    "AsyncRig",
    "AsyncTextureStream",
    "CountedFeed",
    "FingerSample",
    "SampleChunk",
    "connect",
]
