"""Take a rig and follow the finger where Zenoh's port is closed: over the API's WebSocket.

Needs `pip install 'frictus[websocket]'`. A second argument is a token, where the API has them.
"""

import asyncio
import sys

from frictus import Profile, websocket

URL = sys.argv[1] if len(sys.argv) > 1 else websocket.DEFAULT_URL
TOKEN = sys.argv[2] if len(sys.argv) > 2 else None
RIDGES = Profile(friction_n=(0.0, 0.02, 0.0, -0.02), period_mm=2.0)


async def main() -> None:
    """Render ridges, and follow the finger for two seconds."""
    async with websocket.connect(URL, TOKEN) as client:
        rig = await client.rig("rig1")
        async with rig.arm(), rig.blocks("force") as force:
            await rig.set_scene(RIDGES)
            states = 0
            async for finger in rig.fingers(timeout_s=5.0):
                states += 1
                if states % 100 == 0:
                    print(f"x {finger.x_mm:5.1f} mm, speed {finger.vx_mm_s:6.1f} mm/s")
                if states == 400:
                    break
            samples = await anext(force)
            print(f"friction {samples.data[0].mean():.3f} N, {force.lost} samples lost")


asyncio.run(main())
