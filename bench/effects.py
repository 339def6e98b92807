"""Measure what it gains to undo effects and write the table: `python bench/effects.py --help`.

There is no noise, and finger state is known or comes from the touch sensor. Seeds are fresh
each time.
"""

import argparse
import secrets
import statistics
import time
from pathlib import Path as File
from typing import Final

from frictus.recordings import texture_of
from frictus.textures import Region, Scene, Texture
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.motion import Press
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_laboratory.rendering_error import Effects, PlayedStroke, gain_of
from frictus_service.fidelity.path import BLOCK_SAMPLES, walk
from frictus_service.library import SHIPPED
from frictus_service.synthesis.compensability import inverse_of
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import compile_scene

LAW: Final = FrictionLaw()
SCREEN: Final = Screen()
RATE_HZ: Final = 20_000.0
STROKES: Final = ((20.0, 0.3, 2.0), (60.0, 0.5, 10.0), (100.0, 0.4, 18.0))
"""Speed (mm/s), normal force (N) and minute of the session of each."""

UNDONE: Final[dict[str, tuple[str, float]]] = {
    "speed_dependent_cutoff": ("slope_hz_per_mm_s", 9.6),
    "force_dependent_cutoff": ("exponent", 0.36),
    "cutoff_drift": ("per_minute", -0.04),
    "speed_dependent_gain": ("exponent", 0.5),
    "force_dependent_gain": ("exponent", 0.36),
    "gain_drift": ("per_minute", -0.04),
    "direction_asymmetry": ("share", 0.12),
    "position_dependent_gain": ("per_mm", 0.01),
    "charge_leakage": ("corner_hz", 2.0),
    "fractional_rolloff": ("excess_order", 0.24),
    "residual_quadratic": ("share", 0.0096),
    "amplitude_compression": ("share", 0.0096),
}
"""Dose of each effect that has an inverse: twice its realistic size."""
LEFT: Final[dict[str, dict[str, float]]] = {
    "channel_delay": {"delay_s": 8e-6},
    "mount_resonance_shift": {"share": 0.0096},
    "mains_interference": {"amplitude_n": 0.008, "frequency_hz": 50.0},
    "stick_slip": {"amplitude_n": 0.12},
}
"""The same for those that have none."""


def stroke(speed_mm_s: float, force_n: float, minutes: float, known: bool) -> PlayedStroke:
    """Return steady strokes, long enough for a sweep each way."""
    finger = SteadyStrokes(speed_mm_s=speed_mm_s, press=Press(target_n=force_n))
    config = SimulatedConfig(finger=finger, seed=secrets.randbits(32))
    duration_s = max(4.0, 150.0 / speed_mm_s)
    return PlayedStroke(walk(config, duration_s, known), speed_mm_s, minutes)


def cases() -> dict[str, Effects]:
    """Return the effects of each row."""
    single: dict[str, Effects] = {
        id_: [(id_, {name: dose})] for id_, (name, dose) in UNDONE.items()
    }
    half = [(id_, {name: 0.5 * dose}) for id_, (name, dose) in UNDONE.items()]
    return single | {"all of these, realistic": half}


def undone_table(
    texture: Texture, known: list[PlayedStroke], sensed: list[PlayedStroke]
) -> list[str]:
    """Return the table of the effects that have an inverse."""
    lines = [
        "| effect | dose | before | after | waveform before | after "
        "| before, sensed | after, sensed | gain kept |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, effects in cases().items():
        true = gain_of(effects, texture, known, LAW, SCREEN)
        live = gain_of(effects, texture, sensed, LAW, SCREEN)
        dose = f"{next(iter(effects[0][1].values())):g}" if len(effects) == 1 else ""
        lines.append(
            f"| {name} | {dose} | {true.before.rms_db:.3f} dB | {true.after.rms_db:.3f} dB "
            f"| {100 * true.before.waveform:.2f} % | {100 * true.after.waveform:.2f} % "
            f"| {live.before.rms_db:.2f} dB | {live.after.rms_db:.2f} dB "
            f"| {100 * true.applied_share:.0f} % |"
        )
    return lines


def left_table(texture: Texture, known: list[PlayedStroke]) -> list[str]:
    """Return the table of the effects that have none."""
    lines = ["| effect | dose | error | waveform | why |", "|---|---|---|---|---|"]
    for id_, parameters in LEFT.items():
        effects = [(id_, parameters)]
        felt = gain_of(effects, texture, known, LAW, SCREEN).after
        (why,) = inverse_of(LAW, effects).not_rendered.values()
        dose = ", ".join(f"{value:g}" for value in parameters.values())
        lines.append(
            f"| {id_} | {dose} | {felt.rms_db:.3f} dB | {100 * felt.waveform:.2f} % | {why} |"
        )
    return lines


def cost(texture: Texture) -> str:
    """Return how much longer a block takes with every effect undone; medians of one run."""
    everything = [(id_, {name: dose}) for id_, (name, dose) in UNDONE.items()]
    renderers = []
    for law in (LAW, inverse_of(LAW, everything[:8]), inverse_of(LAW, everything)):
        scene = compile_scene(Scene(regions=[Region(texture=texture)]), law, SCREEN, RATE_HZ)
        renderers.append(Renderer(law, SCREEN, RATE_HZ, BLOCK_SAMPLES, scene))
    motion = BlockMotion(20.0, 17.0, 60.0, 0.0, 61.0, 0.0, 60.0, 61.0)
    took: list[list[float]] = [[], [], []]
    for block in range(2_000):
        for renderer, times in zip(renderers, took, strict=True):
            began = time.perf_counter()
            renderer.render(block * BLOCK_SAMPLES, PredictedMotion(motion), allow=True)
            times.append(time.perf_counter() - began)
    plain, varying, every = (statistics.median(times[200:]) for times in took)
    busy = 100.0 * every * RATE_HZ / BLOCK_SAMPLES
    return (
        f"To render a block takes {varying / plain:.1f} times as long as without effects\n"
        f"where only gain and cutoff vary, {every / plain:.1f} times with the whole table:\n"
        f"{busy:.1f} % of the time that it plays (medians of {len(took[0]) - 200} blocks,\n"
        "taken in turn). A model without effects is rendered by the code that knows none."
    )


INTRODUCTION = """# What it gains to undo effects

Made by `uv run python bench/effects.py --out docs/effects.md`; seeds are fresh each time.

A model's `effects` extend its law; the twin simulates with them, and the rig undoes them
(`synthesis/compensability.py`; no effect is known there by its name). Here a finger
has one effect at twice the size that discovery calls realistic. *Before*, the base model is
undone; *after*, the extended one. Texture *flat*, equal lines from 30 to 1000 Hz; steady
strokes at 20, 60 and 100 mm/s with 0.3, 0.5 and 0.4 N, in minutes 2, 10 and 18 of the session.

The error is the level in third octaves from 31.5 Hz to 1 kHz, rms over bands, strokes, both
directions and thirds of the way, with true finger state and no noise; *sensed* is with the
finger as the rig knows it: a touch sensor at 60 Hz, 30 ms late, played 20 ms ahead. *Waveform*
is the rms difference from 20 to 1122 Hz as a share of the target. *Gain kept* is how strong the
texture may still be: scenes are compiled for where the effects leave least.
"""

LIMITS = """
What is undone within limits, as the rig answers when it is given the model (what is not undone
at all stands in `state/model` too, with the reason):

- Drifts count from when the model came into force on the rig, through armings, for 30 minutes;
  then they hold still. Activate the model when the session begins.
- What follows the normal force follows it as last measured, one block and the lead ago, within
  the forces of the model's `validity`. What follows the speed stays within its speeds, what
  follows the position within the screen.
- Of a leaking screen the tactile band is made good. What is slower than 0.25 Hz is not, and
  the bias least of all: to hold a constant force would take a drive that grows for ever.

A simulated finger gets an effect by its configuration:

```toml
[[backend.participant.effects]]
id = "direction_asymmetry"
parameters = { share = 0.12 }
```
"""


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--texture", default="flat", help="a shipped texture")
    parser.add_argument("--out", type=File, help="markdown file; standard output if not given")
    arguments = parser.parse_args()
    texture = texture_of((SHIPPED / f"{arguments.texture}.json").read_text(encoding="utf-8"))
    known = [stroke(*one, known=True) for one in STROKES]
    sensed = [stroke(*one, known=False) for one in STROKES]
    parts = [
        INTRODUCTION,
        "## Undone\n",
        *undone_table(texture, known, sensed),
        LIMITS,
        "## Not undone\n",
        *left_table(texture, known),
        "\n## What it costs\n",
        cost(texture),
    ]
    text = "\n".join(parts) + "\n"
    if arguments.out:
        arguments.out.write_text(text, encoding="utf-8")
    else:
        print(text)  # noqa: T201 - a script


if __name__ == "__main__":
    main()
