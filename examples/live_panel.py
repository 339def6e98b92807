"""Plot speed and normal force of the last three seconds: a panel of one's own.

Writes `panel.png`, or the file that is the second argument. Watching takes no lease.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import frictus

ROUTER = sys.argv[1] if len(sys.argv) > 1 else frictus.DEFAULT_ROUTER
PICTURE = sys.argv[2] if len(sys.argv) > 2 else "panel.png"
SECONDS = 3.0

rows: list[tuple[float, float, float]] = []
with frictus.connect(ROUTER) as client:
    for finger in client.rig("rig1").fingers(timeout_s=5.0):
        rows.append((finger.utc_ns / 1e9, finger.vx_mm_s, finger.normal_force_n))
        if rows[-1][0] - rows[0][0] > SECONDS:
            break

time_s, speed_mm_s, force_n = np.array(rows).T
figure, (upper, lower) = plt.subplots(2, sharex=True, layout="constrained")
upper.plot(time_s - time_s[0], speed_mm_s)
upper.set_ylabel("speed along x, mm/s")
lower.plot(time_s - time_s[0], force_n)
lower.set_ylabel("normal force, N")
lower.set_xlabel("time, s")
figure.savefig(PICTURE)
print(f"{len(rows)} states of the finger in {PICTURE}")
