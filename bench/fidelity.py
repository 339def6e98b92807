"""Measure the rendering error and write its tables: `python bench/fidelity.py --help`.

Everything is measured on the simulated rig with its real lead, sensor and noise, against the
target at the finger's true position. Path seeds are fresh each time and printed.
"""

import argparse
import json
import secrets
import sys
from dataclasses import replace
from pathlib import Path as File

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from frictus.recordings import load_texture, texture_of
from frictus.textures import Texture
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.screen import Screen
from frictus_hardware.physics.stages import Quantisation, SensorNoise, standard_twin
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.motion import Press
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_hardware.simulated.touch import TouchConfig
from frictus_service.fidelity.measure import (
    Error,
    compare,
    feel,
    fixed_at,
    full_gain,
    largest_gain,
    steady_segments,
    target_along,
    uncompensated,
)
from frictus_service.fidelity.path import Path, walk
from frictus_service.fidelity.preview import JND_DB, windows
from frictus_service.library import SHIPPED

RATE_HZ = 20_000.0
SPEEDS_MM_S = (20.0, 40.0, 60.0, 80.0, 100.0)
RECORDED_AT_MM_S = 40.0
SCREEN = Screen()
LAW = FrictionLaw()
MODES = ("compensated", "fixed at 60 mm/s", "none")


def inverses(law: FrictionLaw) -> dict[str, FrictionLaw]:
    """Return the laws that the three ways of rendering invert."""
    return dict(zip(MODES, (law, fixed_at(law, 60.0), uncompensated(law)), strict=True))


def judge(
    path: Path,
    texture: Texture,
    law: FrictionLaw,
    segments: list[slice],
    modes: tuple[str, ...] = MODES,
    true_law: FrictionLaw | None = None,
    noise: bool = True,
) -> dict[str, Error]:
    """Render a texture along a path in several ways; `law` is what the service believes."""
    sensors = (SensorNoise(0.002, 0.05, 1), Quantisation()) if noise else ()
    twin = standard_twin(screen=SCREEN, law=true_law or law, sensors=sensors)
    scene = full_gain(texture, law, SCREEN, RATE_HZ)
    target = target_along(texture, scene, path)
    errors = {}
    for mode in modes:
        signals, clipped = feel(path, scene, inverses(law)[mode], SCREEN, twin)
        errors[mode] = compare(signals, clipped, target, Mount().lateral, segments)
    return errors


def steady_path(speed: float, known: bool, wander: bool = True) -> Path:
    """Return steady strokes, long enough for several sweeps."""
    press = Press() if wander else Press(wander_n=0.0)
    finger = SteadyStrokes(speed_mm_s=speed, press=press)
    config = SimulatedConfig(finger=finger, touch=TouchConfig(), seed=secrets.randbits(32))
    return walk(config, 10.0, known)


def pooled(errors: list[Error]) -> float:
    """Return the rms over the judged bands of several errors."""
    return float(np.sqrt(np.nanmean(np.square([error.bands_db for error in errors]))))


def known_state(textures: dict[str, Texture]) -> tuple[list[str], list[dict[str, object]]]:
    """Measure with true finger state, no noise, no wander."""
    lines = [
        "| texture | gain | of the feasible | waveform error | bands, rms | worst band |",
        "|---|---|---|---|---|---|",
    ]
    figures: list[dict[str, object]] = []
    paths = {speed: steady_path(speed, known=True, wander=False) for speed in SPEEDS_MM_S}
    for name, texture in textures.items():
        errors = [
            judge(path, texture, LAW, steady_segments(path, speed), MODES[:1], noise=False)[
                "compensated"
            ]
            for speed, path in paths.items()
        ]
        gain = 100.0 * full_gain(texture, LAW, SCREEN, RATE_HZ).applied.gain
        share = gain / largest_gain(texture, LAW, np.arange(20.0, 101.0, 2.0), RATE_HZ)
        wave = max(error.waveform for error in errors)
        worst = max(error.worst_db for error in errors)
        lines.append(
            f"| {name} | {gain:.3g} | {100 * share:.1f} % | {100 * wave:.2f} % "
            f"| {pooled(errors):.3f} dB | {worst:.3f} dB |"
        )
        figures.append(
            {"texture": name, "gain": gain, "gain_share": share, "waveform": wave}
            | {"rms_db": pooled(errors), "worst_db": worst}
        )
    return lines, figures


def steady(textures: dict[str, Texture]) -> tuple[list[str], list[dict[str, object]]]:
    """Measure at steady speeds through the touch sensor."""
    lines = [
        "| texture | mm/s | compensated | worst band | fixed at 60 | none | by the sensor |",
        "|---|---|---|---|---|---|---|",
    ]
    figures: list[dict[str, object]] = []
    paths = {speed: steady_path(speed, known=False) for speed in SPEEDS_MM_S}
    for name, texture in textures.items():
        for speed, path in paths.items():
            errors = judge(path, texture, LAW, steady_segments(path, speed))
            best, fixed, none = (errors[mode] for mode in MODES)
            lines.append(
                f"| {name} | {speed:g} | {best.rms_db:.2f} | {best.worst_db:.2f} "
                f"| {fixed.rms_db:.2f} | {none.rms_db:.2f} | {best.sensor_rms_db:.2f} |"
            )
            figures.append(
                {"texture": name, "speed_mm_s": speed, "worst_db": best.worst_db}
                | {mode: errors[mode].rms_db for mode in MODES}
            )
    return lines, figures


def participants(flat: Texture) -> tuple[list[str], list[dict[str, object]]]:
    """Measure participants with half and twice the cutoff, each with a model of their own."""
    lines = [
        "| cutoff | finger state | compensated | fixed at 60 | none |",
        "|---|---|---|---|---|",
    ]
    figures: list[dict[str, object]] = []
    for factor in (0.5, 1.0, 2.0):
        law = replace(
            LAW,
            cutoff_0_hz=factor * LAW.cutoff_0_hz,
            slope_hz_per_mm_s=factor * LAW.slope_hz_per_mm_s,
        )
        for known in (True, False):
            every: dict[str, list[Error]] = {mode: [] for mode in MODES}
            for speed in SPEEDS_MM_S:
                path = steady_path(speed, known)
                for mode, error in judge(path, flat, law, steady_segments(path, speed)).items():
                    every[mode].append(error)
            best, fixed, none = (pooled(every[mode]) for mode in MODES)
            state = "true" if known else "touch sensor"
            lines.append(f"| {factor:g} x | {state} | {best:.3f} | {fixed:.3f} | {none:.3f} |")
            figures.append(
                {"factor": factor, "finger": state}
                | dict(zip(MODES, (best, fixed, none), strict=True))
            )
    return lines, figures


def free(
    textures: dict[str, Texture], n_paths: int
) -> tuple[list[str], list[dict[str, object]]]:
    """Measure free strokes through a touch sensor 30 ms late."""
    seeds = [secrets.randbits(32) for _ in range(n_paths)]
    print(f"path seeds: {seeds}", file=sys.stderr)  # noqa: T201 - a script
    paths = [walk(SimulatedConfig(finger=HumanStrokes(), seed=seed), 10.0) for seed in seeds]
    rms: dict[str, NDArray[np.float64]] = {}
    for name, texture in textures.items():
        rows = []
        for path in paths:
            segments = [
                slice(part.start + 6000, part.stop + 6000)
                for part in windows(path.position_mm.shape[0] - 6000, 8192)
            ]
            errors = judge(path, texture, LAW, segments)
            rows.append([errors[mode].rms_db for mode in MODES])
        rms[name] = np.array(rows)
    groups = {name: rms[name] for name in textures}
    recordings = [rms[name] for name in textures if not name.startswith("flat")]
    if len(recordings) > 1:
        groups["all recordings"] = np.mean(recordings, axis=0)
    lines = [
        "| texture | compensated, mean | worst path | fixed at 60 | none "
        "| compensated less fixed (95 %) |",
        "|---|---|---|---|---|---|",
    ]
    figures: list[dict[str, object]] = []
    for name, values in groups.items():
        apart = values[:, 0] - values[:, 1]
        half = float(stats.t.ppf(0.975, n_paths - 1) * stats.sem(apart))
        mean = float(apart.mean())
        lines.append(
            f"| {name} | {values[:, 0].mean():.2f} | {values[:, 0].max():.2f} "
            f"| {values[:, 1].mean():.2f} | {values[:, 2].mean():.2f} "
            f"| {mean:+.3f} [{mean - half:+.3f}, {mean + half:+.3f}] |"
        )
        figures.append(
            {"texture": name, "worst_path_db": float(values[:, 0].max())}
            | {mode: float(values[:, i].mean()) for i, mode in enumerate(MODES)}
            | {"less_fixed": mean, "less_fixed_ci95": [mean - half, mean + half]}
        )
    lag = np.concatenate([path.position_error_mm() for path in paths])
    lines += [
        "",
        f"Rendered less true position: {float(np.sqrt(np.mean(lag**2))):.2f} mm rms, "
        f"{float(np.abs(lag).max()):.1f} mm at most. "
        f"Mean speed {np.mean([path.speed_mm_s.mean() for path in paths]):.0f} mm/s.",
    ]
    figures.append({"position_rms_mm": float(np.sqrt(np.mean(lag**2))), "seeds": seeds})
    return lines, figures


def wrong_model(textures: dict[str, Texture]) -> tuple[list[str], list[dict[str, object]]]:
    """Measure with a model whose cutoff is 20 % off."""
    lines = ["| texture | 20 % too low | right | 20 % too high |", "|---|---|---|---|"]
    figures: list[dict[str, object]] = []
    paths = {speed: steady_path(speed, known=False) for speed in SPEEDS_MM_S}
    for name, texture in textures.items():
        row = []
        for factor in (0.8, 1.0, 1.2):
            believed = replace(
                LAW,
                cutoff_0_hz=factor * LAW.cutoff_0_hz,
                slope_hz_per_mm_s=factor * LAW.slope_hz_per_mm_s,
            )
            row.append(
                pooled(
                    [
                        judge(
                            path,
                            texture,
                            believed,
                            steady_segments(path, speed),
                            MODES[:1],
                            LAW,
                        )["compensated"]
                        for speed, path in paths.items()
                    ]
                )
            )
        lines.append(f"| {name} | " + " | ".join(f"{value:.2f}" for value in row) + " |")
        figures.append({"texture": name, "low": row[0], "right": row[1], "high": row[2]})
    return lines, figures


INTRODUCTION = f"""# Rendering error

Made by `uv run python bench/fidelity.py --recordings FOLDER --out docs/fidelity.md`; path and
noise seeds are fresh each time. All on the simulated rig with its lead of 20 ms: friction at
the screen against the target at the finger's true position, in third octaves from 31.5 Hz to
1 kHz down to 30 dB under the strongest, in dB rms. The target is the bias that the rig reports
plus the texture; below 2 mm/s electrostatic friction fades, and the target with it. The
difference threshold for the amplitude of electrovibration is {JND_DB} dB.

Each texture has one gain for all speeds, as large as the drive allows. *flat* is equal lines
from 30 to 1000 Hz whatever the speed; the others are recordings, taken as made at
{RECORDED_AT_MM_S:g} mm/s. Steady strokes are judged from 0.25 s after each turn: until then the
touch sensor, 30 ms late at 60 Hz, and the lead have not shown the new speed. *By the sensor* is
what the noisy force sensor reports, its mount removed.
"""


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--recordings", type=File, help="folder of *_filt.csv; else shipped fits"
    )
    parser.add_argument("--paths", type=int, default=20, help="free paths")
    parser.add_argument("--out", type=File, help="markdown file; standard output if not given")
    parser.add_argument("--json", type=File, help="figures as JSON")
    arguments = parser.parse_args()
    fits = {path.stem: texture_of(path.read_text()) for path in sorted(SHIPPED.glob("*.json"))}
    textures: dict[str, Texture] = {"flat": fits.pop("flat")}
    if arguments.recordings is None:
        textures |= fits
    else:
        for path in sorted(arguments.recordings.glob("*_filt.csv")):
            textures[path.stem.removesuffix("_filt")] = load_texture(
                path, speed_mm_s=RECORDED_AT_MM_S, sample_rate_hz=RATE_HZ
            )
    sections = [
        ("True finger state, no noise, no wander", known_state(textures)),
        ("Steady strokes through the 60 Hz touch sensor", steady(textures)),
        ("Participants with their own model, flat texture", participants(textures["flat"])),
        (
            f"Free strokes, {arguments.paths} fresh paths, touch sensor 30 ms late",
            free(textures, arguments.paths),
        ),
        ("A model 20 % off in cutoff, steady strokes", wrong_model(textures)),
    ]
    text = INTRODUCTION
    for title, (lines, _) in sections:
        text += f"\n## {title}\n\n" + "\n".join(lines) + "\n"
    if arguments.out:
        arguments.out.write_text(text, encoding="utf-8")
    else:
        print(text)  # noqa: T201 - a script
    if arguments.json:
        figures = {title: rows for title, (_, rows) in sections}
        arguments.json.write_text(json.dumps(figures, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
