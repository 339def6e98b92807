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
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.human import HumanStrokes
from frictus_laboratory.rendering_error import (
    FUSED,
    KINDS,
    LAW,
    MODES,
    RATE_HZ,
    SCREEN,
    SHORT,
    TOUCH,
    TRUE,
    WAYS,
    Table,
    failing_sensors,
    judge,
    kinematics,
    strokes_at,
    whole,
)
from frictus_service.fidelity.measure import Error, full_gain, largest_gain, steady_segments
from frictus_service.fidelity.preview import JND_DB
from frictus_service.library import SHIPPED

SPEEDS_MM_S = (20.0, 40.0, 60.0, 80.0, 100.0)
RECORDED_AT_MM_S = 40.0


def pooled(errors: list[Error]) -> float:
    """Return the rms over the judged bands of several errors."""
    return float(np.sqrt(np.nanmean(np.square([error.bands_db for error in errors]))))


def known_state(textures: dict[str, Texture]) -> Table:
    """Measure with true finger state, no noise, no wander."""
    lines = [
        "| texture | gain | of the feasible | waveform error | bands, rms | worst band |",
        "|---|---|---|---|---|---|",
    ]
    figures: list[dict[str, object]] = []
    paths = {speed: TRUE.walk(strokes_at(speed, False), 10.0) for speed in SPEEDS_MM_S}
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


def steady(textures: dict[str, Texture]) -> Table:
    """Measure between the turns of steady strokes, from 0.25 s after each."""
    ways = (TOUCH, FUSED, SHORT)
    lines = [
        "| texture | mm/s | "
        + " | ".join(f"{way.name} | worst band" for way in ways)
        + " | fixed at 60 | none | by the sensor |",
        "|---|---|" + "---|" * (2 * len(ways) + 3),
    ]
    figures: list[dict[str, object]] = []
    configs = {speed: strokes_at(speed) for speed in SPEEDS_MM_S}
    for name, texture in textures.items():
        scene = full_gain(texture, LAW, SCREEN, RATE_HZ)
        for speed, config in configs.items():
            cells, others = [], []
            for way in ways:
                path = way.walk(config, 10.0, scene)
                modes = MODES if way is FUSED else MODES[:1]
                errors = judge(path, texture, LAW, steady_segments(path, speed), modes)
                best = errors[MODES[0]]
                cells.append(f"{best.rms_db:.2f} | {best.worst_db:.2f}")
                figures.append(
                    {"texture": name, "speed_mm_s": speed, "way": way.name}
                    | {"rms_db": best.rms_db, "worst_db": best.worst_db}
                )
                if way is FUSED:
                    others = [errors[mode].rms_db for mode in MODES[1:]]
                    others.append(best.sensor_rms_db)
            shown = " | ".join(f"{value:.2f}" for value in others)
            lines.append(f"| {name} | {speed:g} | {' | '.join(cells)} | {shown} |")
    return lines, figures


def whole_strokes(textures: dict[str, Texture], n_seeds: int) -> Table:
    """Measure whole strokes, turns included, each way on the same paths."""
    lines = [
        "| texture | mm/s | "
        + " | ".join(f"{way.name} | worst band" for way in WAYS)
        + " | fixed at 60, fused, 20 ms | fixed at 60, true |",
        "|---|---|" + "---|" * (2 * len(WAYS) + 2),
    ]
    figures: list[dict[str, object]] = []
    for speed in KINDS:
        configs = [strokes_at(speed) for _ in range(n_seeds)]
        for name, texture in textures.items():
            scene = full_gain(texture, LAW, SCREEN, RATE_HZ)
            cells, fixed = [], {}
            for way in WAYS:
                modes = MODES[:2] if way in (FUSED, TRUE) else MODES[:1]
                paths = [way.walk(config, 11.0, scene) for config in configs]
                found = [judge(path, texture, LAW, whole(path), modes) for path in paths]
                best = [errors[MODES[0]] for errors in found]
                worst = max(error.worst_db for error in best)
                cells.append(f"{pooled(best):.2f} | {worst:.1f}")
                if len(modes) > 1:
                    fixed[way.name] = pooled([errors[MODES[1]] for errors in found])
                figures.append(
                    {"texture": name, "speed_mm_s": speed, "way": way.name}
                    | {"rms_db": pooled(best), "worst_db": worst}
                )
            shown = " | ".join(f"{value:.2f}" for value in fixed.values())
            lines.append(f"| {name} | {speed:g} | {' | '.join(cells)} | {shown} |")
    return lines, figures


def offsets(texture: Texture) -> Table:
    """Measure what a constant offset of the position costs while all else is true."""
    lines = ["| offset | 60 mm/s | 100 mm/s | free |", "|---|---|---|---|"]
    figures: list[dict[str, object]] = []
    free_strokes = SimulatedConfig(finger=HumanStrokes(), seed=secrets.randbits(32))
    configs = (strokes_at(60.0), strokes_at(100.0), free_strokes)
    paths = [TRUE.walk(config, 21.0) for config in configs]
    for offset_mm in (0.0, 0.02, 0.05, 0.1, 0.2):
        found = []
        for path in paths:
            moved = tuple(
                each._replace(motion=each.motion._replace(x_mm=each.motion.x_mm + offset_mm))
                for each in path.courses
            )
            aside = replace(path, courses=moved)
            found.append(judge(aside, texture, LAW, whole(path), MODES[:1])[MODES[0]])
        cells = [f"{error.rms_db:.2f} ({error.worst_db:.1f})" for error in found]
        lines.append(f"| {offset_mm:g} mm | {' | '.join(cells)} |")
        figures.append({"offset_mm": offset_mm, "rms_db": [error.rms_db for error in found]})
    return lines, figures


def participants(flat: Texture) -> Table:
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
        scene = full_gain(flat, law, SCREEN, RATE_HZ)
        for known in (True, False):
            every: dict[str, list[Error]] = {mode: [] for mode in MODES}
            for speed in SPEEDS_MM_S:
                path = (TRUE if known else FUSED).walk(strokes_at(speed), 10.0, scene)
                for mode, error in judge(path, flat, law, steady_segments(path, speed)).items():
                    every[mode].append(error)
            best, fixed, none = (pooled(every[mode]) for mode in MODES)
            state = "true" if known else "fused"
            lines.append(f"| {factor:g} x | {state} | {best:.3f} | {fixed:.3f} | {none:.3f} |")
            figures.append(
                {"factor": factor, "finger": state}
                | dict(zip(MODES, (best, fixed, none), strict=True))
            )
    return lines, figures


def free(textures: dict[str, Texture], n_paths: int) -> Table:
    """Measure free strokes each way on the same paths, with all of each path."""
    seeds = [secrets.randbits(32) for _ in range(n_paths)]
    print(f"path seeds: {seeds}", file=sys.stderr)  # noqa: T201 - a script
    configs = [SimulatedConfig(finger=HumanStrokes(), seed=seed) for seed in seeds]
    # [way, mode, path]
    rms_db: dict[str, NDArray[np.float64]] = {}
    for name, texture in textures.items():
        scene = full_gain(texture, LAW, SCREEN, RATE_HZ)
        rms_db[name] = np.zeros((len(WAYS), 2, n_paths))
        for row, way in enumerate(WAYS):
            for number, config in enumerate(configs):
                path = way.walk(config, 11.0, scene)
                errors = judge(path, texture, LAW, whole(path), MODES[:2])
                rms_db[name][row, :, number] = [errors[mode].rms_db for mode in MODES[:2]]
    groups = dict(rms_db)
    recordings = [rms_db[name] for name in textures if not name.startswith("flat")]
    if len(recordings) > 1:
        groups["all recordings"] = np.mean(recordings, axis=0)
    lines = [
        "| texture | "
        + " | ".join(way.name for way in WAYS)
        + " | fixed at 60: "
        + " | ".join(way.name for way in WAYS)
        + " | fused, 20 ms, less fixed (95 %) | share of what true state gains |",
        "|---|" + "---|" * (2 * len(WAYS) + 2),
    ]
    figures: list[dict[str, object]] = []
    for name, values in groups.items():
        mean = values.mean(axis=2)
        apart = values[1, 0] - values[1, 1]
        half = float(stats.t.ppf(0.975, n_paths - 1) * stats.sem(apart))
        share = (mean[1, 1] - mean[1, 0]) / (mean[3, 1] - mean[3, 0])
        cells = " | ".join(f"{value:.2f}" for value in (*mean[:, 0], *mean[:, 1]))
        lines.append(
            f"| {name} | {cells} | {apart.mean():+.3f} "
            f"[{apart.mean() - half:+.3f}, {apart.mean() + half:+.3f}] | {100 * share:.0f} % |"
        )
        figures.append(
            {"texture": name, "less_fixed": float(apart.mean()), "half_95": half}
            | {way.name: float(mean[row, 0]) for row, way in enumerate(WAYS)}
        )
    figures.append({"seeds": seeds})
    return lines, figures


def wrong_model(textures: dict[str, Texture]) -> Table:
    """Measure with a model whose cutoff is 20 % off."""
    lines = ["| texture | 20 % too low | right | 20 % too high |", "|---|---|---|---|"]
    figures: list[dict[str, object]] = []
    paths = {speed: FUSED.walk(strokes_at(speed), 10.0) for speed in SPEEDS_MM_S}
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
noise seeds are fresh each time. All on the simulated rig: friction at
the screen against the target at the finger's true position, in third octaves from 31.5 Hz to
1 kHz down to 30 dB under the strongest, in dB rms. The target is the bias that the rig reports
plus the texture; below 2 mm/s electrostatic friction fades, and the target with it. The
difference threshold for the amplitude of electrovibration is {JND_DB} dB.

Each texture has one gain for all speeds, as large as the drive allows. *flat* is equal lines
from 30 to 1000 Hz whatever the speed; the others are recordings, taken as made at
{RECORDED_AT_MM_S:g} mm/s. *Touch*: the 60 Hz touch sensor alone, 30 ms late, with an output
that is queued 20 ms ahead. *Fused*: with the acceleration of the nail and the force, while
the texture plays and shakes the nail. *By the sensor*: what the noisy force sensor reports,
its mount removed.
"""


OFFSETS = "What a constant offset of the position costs, Paper"
NOTES = {
    OFFSETS: """
DB rms over the bands, and the worst band; everything but the offset is true. Strokes of a fixed
span turn at the same two places each time, and the lowest bands hold the turns alone: there the
level hangs on where exactly on the texture the finger turns, to far less than the 0.1 mm of a
touch report.
""",
}


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--recordings", type=File, help="folder of *_filt.csv; else shipped fits"
    )
    parser.add_argument("--paths", type=int, default=20, help="free paths; a fifth for strokes")
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
    paper = textures["Paper"] if "Paper" in textures else textures["paper"]
    n_paths = arguments.paths
    n_seeds = max(2, n_paths // 5)
    sections = [
        ("True finger state, no noise, no wander", known_state(textures)),
        ("Where the finger is rendered, Paper playing", kinematics(paper, n_seeds)),
        ("Whole strokes, nothing left out", whole_strokes(textures, n_seeds)),
        (OFFSETS, offsets(paper)),
        (f"Free strokes, nothing left out, {n_paths} fresh paths", free(textures, n_paths)),
        ("Steady strokes between turns, from 0.25 s after each", steady(textures)),
        ("Sensors that fail, 60 mm/s, Paper playing", failing_sensors(paper)),
        ("Participants with their own model, flat texture", participants(textures["flat"])),
        ("A model 20 % off in cutoff, steady strokes", wrong_model(textures)),
    ]
    text = INTRODUCTION
    for title, (lines, _) in sections:
        text += f"\n## {title}\n\n" + "\n".join(lines) + "\n"
        text += NOTES.get(title, "")
    if arguments.out:
        arguments.out.write_text(text, encoding="utf-8")
    else:
        print(text)  # noqa: T201 - a script
    if arguments.json:
        figures = {title: rows for title, (_, rows) in sections}
        arguments.json.write_text(json.dumps(figures, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
