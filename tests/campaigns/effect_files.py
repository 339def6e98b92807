"""Damaged effect files and HaTT models: `python -m tests.campaigns.effect_files
lines.jsonl --cases 500`.

Each is read as a texture by what every door uses, `frictus.recordings.import_texture`. What
must hold: a texture or a refusal in words, in `MOST_S` of processor time, and at most
`MOST_MB` of memory.
"""

import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any, Final

import numpy as np
from tests.campaigns.lines import Line, asked, go_on
from tests.campaigns.mutations import (
    Mutant,
    draw_damaged,
    draw_damaged_bytes,
    draw_damaged_text,
)
from tests.clients.effect_files.hmpg_writer import hmpg
from tests.clients.effect_files.wavelet_coder import stream

from frictus.effect_files import EFFECT_SUFFIXES
from frictus.errors import TextureError
from frictus.recordings import import_texture
from frictus.sample_files import MAX_TEXT_BYTES

HATT: Final = ".xml"
BINARY: Final = ".hmpg"
SUFFIXES: Final = (*EFFECT_SUFFIXES, HATT)
CASES: Final = 25
"""Of one batch."""
MOST_S: Final = 20.0
MOST_MB: Final = 1_000.0
Tree = dict[str, Any]


def names(cases: int) -> list[str]:
    """Return the names of the batches that make up so many cases."""
    count = -(-cases // CASES)
    return [f"{SUFFIXES[n % len(SUFFIXES)]}/{n}" for n in range(count)]


def run(name: str, seed: int, cases: int = CASES) -> Line:
    """Read the damaged files of a batch."""
    suffix, rng = name.split("/")[0], random.Random(seed)
    outcomes: Counter[str] = Counter()
    failures, slowest_s = [], 0.0
    with tempfile.TemporaryDirectory(prefix="frictus-") as folder:
        path = Path(folder) / f"damaged{suffix}"
        for case in range(cases):
            mutant = _drawn(suffix, rng)
            path.write_bytes(mutant.payload)
            begun_s = time.process_time()
            try:
                if suffix == HATT:
                    import_texture(path, scale_n=0.01, node=(100.0, 1.0))
                else:
                    import_texture(path, rng.choice([None, 40.0]), scale_n=0.5)
                outcomes["texture"] += 1
            except TextureError as error:
                outcomes["refused" if str(error) else "refused without a word"] += 1
            except Exception as error:
                failures.append({"what": f"case {case} ({mutant.how}): {error!r}"})
            took_s = time.process_time() - begun_s
            slowest_s = max(slowest_s, took_s)
            if took_s > MOST_S:
                failures.append({"what": f"case {case} ({mutant.how}): {took_s:.0f} s"})
    if (used := memory_mb()) is not None and used > MOST_MB:
        failures.append({"what": f"{used:.0f} MB of memory"})
    return {
        "cases": cases,
        "outcomes": outcomes,
        "slowest_s": round(slowest_s, 3),
        "memory_mb": used,
        "failures": failures,
    }


def _drawn(suffix: str, rng: random.Random) -> Mutant:
    if suffix == HATT:
        return draw_damaged_text(draw_hatt(rng), MAX_TEXT_BYTES, rng)
    if suffix == BINARY:
        return draw_damaged_bytes(draw_hmpg(rng), MAX_TEXT_BYTES, rng)
    return draw_damaged(draw_effect(suffix, rng), MAX_TEXT_BYTES, rng)


def draw_hmpg(rng: random.Random) -> bytes:
    """Return a valid binary file with something of all that its format has."""
    return hmpg(_hjif(rng), rng.choice([50, 128, 10**6]))


def draw_hatt(rng: random.Random) -> bytes:
    """Return a valid HaTT model of some nodes."""
    nodes = ""
    for _ in range(rng.randint(1, 6)):
        ar = [1.0, *(rng.uniform(-0.08, 0.08) for _ in range(10))]
        values = "".join(f"<value>{number:.6f}</value>" for number in ar)
        speed, force, var = (
            rng.uniform(10.0, 200.0),
            rng.uniform(0.1, 3.0),
            rng.uniform(0.1, 9.0),
        )
        nodes += (
            f"<model><ARcoeff>{values}</ARcoeff><ARlsf>{values}</ARlsf><var>{var:.6f}</var>"
        )
        nodes += f"<speedMod>{speed:.6f}</speedMod><forceMod>{force:.6f}</forceMod></model>"
    head = (
        "<material>Felt</material><SampleRate>10000</SampleRate><SpeedUnits>mm/s</SpeedUnits>"
    )
    return f'<?xml version="1.0" encoding="utf-8"?><modelSet>{head}{nodes}</modelSet>'.encode()


def memory_mb() -> float | None:
    """Return the most memory that this process ever had, MB; None on Windows."""
    if sys.platform == "linux":  # what getrusage says begins with the peak of who started it
        status = Path("/proc/self/status").read_text(encoding="ascii")
        (peak_kb,) = (line.split()[1] for line in status.splitlines() if "VmHWM" in line)
        return round(int(peak_kb) / 1_024, 1)
    try:
        import resource
    except ImportError:
        return None
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1_048_576, 1)  # macOS: B


def draw_effect(suffix: str, rng: random.Random) -> Tree:
    """Return a valid effect document with something of all that its format has."""
    return {".ahap": _ahap, ".haptic": _haptic, ".hjif": _hjif}[suffix](rng)


def _ahap(rng: random.Random) -> Tree:
    names = ("HapticIntensity", "HapticSharpness", "AttackTime", "DecayTime", "ReleaseTime",
             "Sustained")  # fmt: skip
    controls = [f"Haptic{name}Control" for name in ("Intensity", "Sharpness", "AttackTime")]
    pattern: list[Tree] = []
    kinds = ["HapticTransient", "HapticContinuous", "AudioCustom"]
    for kind in ["HapticContinuous", *rng.choices(kinds, k=rng.randint(1, 5))]:
        parameters = [
            {"ParameterID": name, "ParameterValue": rng.random()}
            for name in rng.sample(names, 3)
        ]
        event = {
            "Time": rng.uniform(0.0, 3.0),
            "EventType": kind,
            "EventParameters": parameters,
        }
        pattern.append({"Event": event | {"EventDuration": rng.uniform(0.01, 2.0)}})
    for _ in range(rng.randint(0, 3)):
        points = [{"Time": t / 4.0, "ParameterValue": rng.random()} for t in range(4)]
        curve = {"ParameterID": rng.choice(controls), "Time": rng.uniform(0.0, 2.0)}
        pattern.append({"ParameterCurve": curve | {"ParameterCurveControlPoints": points}})
        pattern.append({"Parameter": curve | {"ParameterValue": rng.random()}})
    return {"Version": 1.0, "Pattern": pattern}


def _haptic(rng: random.Random) -> Tree:
    times = sorted(rng.uniform(0.0, 5.0) for _ in range(rng.randint(2, 20)))
    amplitude: list[Tree] = [{"time": t, "amplitude": rng.random()} for t in times]
    for point in rng.sample(amplitude, rng.randint(0, 2)):
        point["emphasis"] = {"amplitude": 1.0, "frequency": rng.random()}
    frequency = [{"time": t, "frequency": rng.random()} for t in times]
    envelopes = {"amplitude": amplitude, "frequency": frequency}
    return {"version": {"major": 1}, "signals": {"continuous": {"envelopes": envelopes}}}


def _hjif(rng: random.Random) -> Tree:
    bands = []
    bands.append(_blocks(rng))
    for kind in rng.choices(["Transient", "VectorialWave", "Curve"], k=rng.randint(1, 4)):
        effects: list[Tree] = [{"effect_type": "Reference", "id": 1, "position": 700}]
        for position in sorted(rng.randrange(3_000) for _ in range(rng.randint(1, 4))):
            signal = rng.choice(["Sine", "Square", "Triangle", "SawToothUp", "SawToothDown"])
            effect = {"effect_type": "Basis", "base_signal": signal, "phase": rng.random()}
            effects.append(effect | {"position": position, "keyframes": _keyframes(rng)})
        curve = rng.choice(["Cubic", "Linear", "Akima", "Unknown"])
        band = {"band_type": kind, "curve_type": curve, "upper_frequency_limit": 1_000}
        bands.append(band | {"effects": effects})
    library = [{"id": 1, "effect_type": "Basis", "position": 0, "keyframes": _keyframes(rng)}]
    channels = [{"gain": rng.uniform(0.1, 3.0), "mixing_coefficient": 1.0, "bands": bands}]
    perception = {"id": 3, "perception_modality": "Vibrotactile", "effect_library": library}
    perceptions = [perception | {"perception_unit_exponent": 0, "channels": channels}]
    return {"version": "2023", "timescale": 1_000, "perceptions": perceptions}


def _blocks(rng: random.Random) -> Tree:
    """Return a wavelet band of three blocks, one of them silent."""
    course = [rng.gauss(0.0, 0.2) for _ in range(256)]
    streams = [stream(np.array(course), rng.randint(3, 10)) for _ in range(2)]
    effects = [
        {"effect_type": "Basis", "position": 32 * n, "wavelet_stream": text}
        for n, text in enumerate([streams[0], "", streams[1]])
    ]
    made = {"band_type": "WaveletWave", "block_length": 32, "upper_frequency_limit": 8_000}
    return made | {"effects": effects}


def _keyframes(rng: random.Random) -> list[Tree]:
    return [
        {
            "relative_position": 50 * n,
            "amplitude_modulation": rng.uniform(-1.0, 1.0),
            "frequency_modulation": rng.randint(20, 400),
        }
        for n in range(rng.randint(2, 8))
    ]


def main() -> None:
    """Run the campaign, or a part of it."""
    for line in go_on(*asked(__doc__, "cases", 500, "damaged files", names), run):
        told = {key: line[key] for key in ("outcomes", "slowest_s", "memory_mb", "failures")}
        sys.stdout.write(f"{line['name']} {line['seed']} {told}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
