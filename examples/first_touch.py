"""Take a rig, let it feel like ridges of 2 mm, and follow the finger for two seconds."""

import sys

import frictus

ROUTER = sys.argv[1] if len(sys.argv) > 1 else frictus.DEFAULT_ROUTER
RIDGES = frictus.Spectrum(
    components=[frictus.Component(amplitude_n=0.05, cycles_per_mm=0.5)],
)

with frictus.connect(ROUTER) as client:
    rig = client.rig("rig1")
    with rig.arm():  # the screen is driven only while this block runs
        state = rig.set_scene(RIDGES)
        print(f"applied at {100 * state.applied.gain:.0f} % of what was asked for")
        began_ns = None
        for finger in rig.fingers():
            began_ns = began_ns or finger.utc_ns
            print(f"x {finger.x_mm:6.1f} mm  speed {finger.vx_mm_s:7.1f} mm/s")
            if finger.utc_ns - began_ns > 2e9:
                break
