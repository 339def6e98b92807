"""Change what the screen feels like twenty times a second: ridges whose height breathes."""

import sys
import time

import numpy as np

import frictus

ROUTER = sys.argv[1] if len(sys.argv) > 1 else frictus.DEFAULT_ROUTER
PEAK_N = 0.05
RATE_HZ = 20.0
UPDATES = 40

ridge = np.sin(2.0 * np.pi * np.arange(64) / 64)  # one period
with frictus.connect(ROUTER) as client:
    rig = client.rig("rig1")
    before = rig.status().counters.stream_updates  # of all streams since the rig began
    with rig.arm(), rig.open_stream(peak_n=PEAK_N) as stream:
        for update in range(UPDATES):
            height_n = PEAK_N * (0.6 + 0.4 * np.sin(2.0 * np.pi * update / 20))
            stream.send(height_n * ridge, period_mm=2.0)
            time.sleep(1.0 / RATE_HZ)
        taken = rig.status().counters.stream_updates - before
    print(f"{stream.sent} updates sent, {taken} taken")
