"""Find a detection threshold: two intervals, one with a texture, three-down one-up staircase.

The observer is simulated, so that the program runs by itself; put a key press in its place.
Every trial is a row of CSV with what the rig applied, not only with what was asked for.
"""

import csv
import math
import random
import sys
import time

import frictus

ROUTER = sys.argv[1] if len(sys.argv) > 1 else frictus.DEFAULT_ROUTER
THRESHOLD_N = 0.02
"""Of the simulated observer."""
INTERVAL_S = 0.1
TRIALS = 12
STEP = 2.0**0.5


def ridges(amplitude_n: float) -> frictus.Spectrum:
    """Return ridges of 2 mm."""
    component = frictus.Component(amplitude_n=amplitude_n, cycles_per_mm=0.5)
    return frictus.Spectrum(components=[component])


def answer(rng: random.Random, interval: int, amplitude_n: float) -> int:
    """Return the interval that the observer names; a Weibull function of the amplitude."""
    knows = 1.0 - math.exp(-((amplitude_n / THRESHOLD_N) ** 3.0))
    return interval if rng.random() < knows else rng.randrange(2)


rng = random.Random(1)
amplitude_n, right_in_a_row = 0.08, 0
table = csv.writer(sys.stdout)
table.writerow(["trial", "amplitude_n", "applied_gain", "interval", "answer", "right"])
with frictus.connect(ROUTER) as client:
    rig = client.rig("rig1")
    with rig.arm(lease_ms=2_000, keep_model=True):  # the same for every trial
        for trial in range(TRIALS):
            texture_in = rng.randrange(2)
            gain = 1.0
            for interval in range(2):
                shown = ridges(amplitude_n) if interval == texture_in else frictus.Scene()
                applied = rig.set_scene(shown).applied
                gain = applied.gain if interval == texture_in else gain
                time.sleep(INTERVAL_S)
            given = answer(rng, texture_in, amplitude_n)
            right = given == texture_in
            row = [f"{amplitude_n:.4f}", f"{gain:.3f}", texture_in, given, right]
            table.writerow([trial, *row])
            right_in_a_row = right_in_a_row + 1 if right else 0
            if not right:
                amplitude_n = min(amplitude_n * STEP, 0.1)
            elif right_in_a_row == 3:
                amplitude_n, right_in_a_row = amplitude_n / STEP, 0
