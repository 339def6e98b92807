"""Render the same scene on every rig of a site, and print where each finger is."""

import contextlib
import sys

import frictus

ROUTER = sys.argv[1] if len(sys.argv) > 1 else frictus.DEFAULT_ROUTER
SCENE = frictus.Scene(
    regions=[
        frictus.Region(
            texture=frictus.Slope(peak_hz=150.0, low_order=2, high_order=2, rms_n=0.02),
            x_mm=(0.0, 40.0),
            name="rough half",
        )
    ]
)

with frictus.connect(ROUTER) as client, contextlib.ExitStack() as armed:
    rigs = [client.rig(found.name, found.site) for found in client.rigs(site="lab")]
    for rig in rigs:
        armed.enter_context(rig.arm(lease_ms=1_000))
        rig.set_scene(SCENE)
    for rig in rigs:
        finger = next(iter(rig.fingers(timeout_s=5.0)))
        print(f"{rig.name}: x {finger.x_mm:.1f} mm, {finger.normal_force_n:.2f} N")
