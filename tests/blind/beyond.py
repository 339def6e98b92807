"""Studies with what no catalogue has: `python -m tests.blind.beyond --help`.

Beside them causes of the catalogue in shapes that it has not: stick-slip of a skin that is
loaded and breaks loose, and the mains, which must not be taken for each other.

One line of JSON each; what is in the file is not made again. The kinds are drawn anew, size and
place, for every study; nothing of the analysis is imported but the command that is tried.
"""

import argparse
import json
import secrets
import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from tests.blind.campaign import analyse, read
from tests.blind.cases import cause
from tests.blind.generator import Case, Design, Hidden, Seeds, make_study

PEOPLE, SECONDS = 8, 1.5
MANY_TONES: Final = Design(PEOPLE, n_tones=15, n_speeds=3, n_forces=1, seconds=SECONDS)
MANY_FORCES: Final = Design(PEOPLE, n_tones=3, n_speeds=3, n_forces=5, seconds=SECONDS)
USUAL: Final = Design(PEOPLE, n_tones=5, n_speeds=3, n_forces=3, seconds=SECONDS)
"""45 trials each; a third of the size of the campaign on the catalogue, for its time."""
MANY_SPEEDS: Final = Design(PEOPLE, n_tones=5, n_speeds=5, n_forces=2, seconds=SECONDS)
SLOW: Final = Design(PEOPLE, n_tones=5, n_speeds=4, n_forces=2, seconds=2.0)
"""Without drive nothing is seen of a response; what is, is seen at the lowest speed best."""

SHAPES: Final[Mapping[str, str]] = {
    "sawtooth": "stick_slip",
    "mains": "mains_interference",
}
"""Causes of the catalogue, by the kind that hides them."""
MISTAKEN: Final = frozenset(SHAPES.values())

DESIGNS: Final[Mapping[str, Design]] = {
    "null": USUAL,
    "extra_resonance": MANY_TONES,
    "notch_at_speed": MANY_TONES,
    "echo": MANY_TONES,
    "two_time_constants": MANY_TONES,
    "coupling": USUAL,
    "time_step": USUAL,
    "contact_loss": MANY_FORCES,
    "force_saturation": MANY_FORCES,
    "bent_cutoff": MANY_SPEEDS,
    "light_cutoff": MANY_FORCES,
    "sawtooth": SLOW,
    "mains": SLOW,
}
FORMS: Final[Mapping[str, frozenset[str]]] = {
    "extra_resonance": frozenset({"extra_resonance"}),
    "notch_at_speed": frozenset({"extra_resonance"}),
    "echo": frozenset({"echo"}),
    "two_time_constants": frozenset({"pole_zero_pair"}),
    "coupling": frozenset({"gain_coupling_of_speed_and_force"}),
    "time_step": frozenset({"gain_switch_by_time"}),
    "contact_loss": frozenset({"gain_switch_by_force", "gain_knee_below_force"}),
    "force_saturation": frozenset({"gain_knee_above_force", "gain_switch_by_force"}),
    "bent_cutoff": frozenset({"cutoff_knee_above_speed", "cutoff_switch_by_speed"}),
    "light_cutoff": frozenset({"cutoff_switch_by_force", "cutoff_knee_below_force"}),
}
"""Which forms of the grammar are right."""
TRUE_PARAMETER: Final[Mapping[str, tuple[str, str, str]]] = {
    "extra_resonance": ("extra_resonance", "frequency_hz", "frequency_hz"),
    "notch_at_speed": ("extra_resonance", "frequency_hz", "frequency_hz"),
    "echo": ("echo", "delay_s", "delay_s"),
    "two_time_constants": ("pole_zero_pair", "corner_hz", "corner_hz"),
    "coupling": ("gain_coupling_of_speed_and_force", "exponent", "exponent"),
    "time_step": ("gain_switch_by_time", "threshold_min", "minutes"),
    "contact_loss": ("gain_switch_by_force", "threshold_n", "force_n"),
    "force_saturation": ("gain_knee_above_force", "threshold_n", "force_n"),
    "bent_cutoff": ("cutoff_knee_above_speed", "threshold_mm_s", "speed_mm_s"),
    "light_cutoff": ("cutoff_switch_by_force", "threshold_n", "force_n"),
}
"""Form, its parameter, and that of the generator, where the equations have it in common."""
SHAPE_OF: Final[Mapping[str, str]] = {
    "bent_cutoff": "speed_dependent_cutoff",
    "light_cutoff": "force_dependent_cutoff",
    "force_saturation": "force_dependent_gain",
    "contact_loss": "force_dependent_gain",
    "time_step": "gain_drift",
}
"""Causes of the catalogue of which what is hidden is another shape."""


def draw(kind: str, rng: np.random.Generator) -> Case:
    """Return a case of a kind, its parameters drawn anew."""
    sign = float(rng.choice([-1.0, 1.0]))

    def uniform(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    drawn: dict[str, dict[str, float]] = {
        "extra_resonance": {
            "depth": 10.0 ** (sign * uniform(1.5, 3.0) / 20.0) - 1.0,
            "frequency_hz": log(80.0, 1200.0),
            "quality": uniform(3.0, 8.0),
        },
        "notch_at_speed": {
            "depth": uniform(0.25, 0.45),
            "frequency_hz": log(120.0, 1000.0),
            "quality": uniform(2.0, 4.0),
        },
        "echo": {
            "share": sign * uniform(0.08, 0.2),
            "delay_s": round(log(4e-4, 3e-3) / 5e-5) * 5e-5,
        },
        "two_time_constants": {"share": uniform(0.3, 0.8), "corner_hz": log(60.0, 500.0)},
        "coupling": {"exponent": sign * uniform(0.3, 0.6)},
        "time_step": {"log_change": sign * uniform(0.2, 0.4), "minutes": uniform(4.0, 11.0)},
        "contact_loss": {"share": uniform(0.3, 0.6), "force_n": uniform(0.26, 0.34)},
        "force_saturation": {"exponent": uniform(0.5, 1.0), "force_n": uniform(0.36, 0.48)},
        "bent_cutoff": {
            "exponent": sign * uniform(0.4, 0.8),
            "speed_mm_s": uniform(45.0, 75.0),
        },
        "light_cutoff": {"share": uniform(0.3, 0.6), "force_n": uniform(0.26, 0.34)},
    }
    if kind in SHAPES:
        size = float(rng.choice(SIZES))
        return Case("other_shape", (_shaped(kind, size, rng),), DESIGNS[kind])
    hidden = () if kind == "null" else (Hidden(kind, drawn[kind], "unknown"),)
    return Case("null" if kind == "null" else "unknown", hidden, DESIGNS[kind])


SIZES: Final = (0.6, 1.0)
"""Times the realistic size."""


def _shaped(kind: str, size: float, rng: np.random.Generator) -> Hidden:
    """Return a cause of the catalogue; every other stick-slip is that of a skin that relaxes.

    It goes 1 to 3 mm at 20 mm/s until it breaks loose.
    """
    plain = cause(SHAPES[kind], size, rng)
    if kind == "mains" or rng.uniform() < 0.5:
        return plain
    peak_n = plain.parameters["amplitude_n"]
    way_mm = float(np.exp(rng.uniform(0.0, np.log(3.0))))
    stiffness = 2.0 * peak_n * float(np.exp(-1.0)) / way_mm
    values = {"amplitude_n": peak_n, "stiffness_n_per_mm": stiffness}
    return Hidden("stick_slip", values, "relaxing")


def score(report: Mapping[str, Any], case: Case) -> dict[str, Any]:
    """Return what a report got right of a case: null where it cannot be said."""
    forms = report["characterised"]
    line: dict[str, Any] = {
        "verdict": report["verdict"],
        "causes": {cause["id"]: cause["verdict"] for cause in report["causes"]},
        "pairs": [pair["between"] for pair in report["cannot_tell"]],
        "left": [[u["channel"], u["covariate"], u["band_hz"]] for u in report["unexplained"]],
        "form": forms[0]["id"] if forms else None,
        "statement": forms[0]["statement"] if forms else None,
        "flagged": bool(forms or report["unexplained"]),
        "share": forms[0]["share"] if forms else None,
        "nats": forms[0]["nats_per_person"] if forms else None,
        "rivals": [each["id"] for each in forms[0]["rivals"]] if forms else [],
    }
    if case.kind == "other_shape":
        named = set(line["causes"]) & MISTAKEN
        line["right"] = named == {case.hidden[0].name}
    elif case.hidden:
        (hidden,) = case.hidden
        line["right"] = line["form"] in FORMS[hidden.name]
        form, parameter, true = TRUE_PARAMETER[hidden.name]
        if line["form"] == form:
            low, high = forms[0]["parameters"][parameter]["ci95"]
            value = _half_lost(hidden) if hidden.name in HALVES else hidden.parameters[true]
            line["estimate"] = [value, low, high]
            line["covered"] = low <= value <= high
    return line


HALVES: Final = frozenset({"contact_loss", "light_cutoff"})


def _half_lost(hidden: Hidden) -> float:
    """Return the force at which half of the change of a logarithm is reached.

    The threshold of the grammar's switch is defined so; the generator's is that of the factor.
    """
    share = hidden.parameters["share"]
    ratio = share / (1.0 - np.sqrt(1.0 - share)) - 1.0
    return float(hidden.parameters["force_n"] * ratio ** (1.0 / 12.0))


def run(kind: str, number: int, seed: int) -> dict[str, Any]:
    """Make a study, have it analysed, and return its line; an error is in the line."""
    case = draw(kind, np.random.default_rng(seed))
    line = {"name": f"{kind}/{number}", "kind": kind, "seed": seed, "case": asdict(case)}
    began = time.perf_counter()
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{secrets.token_hex(8)}.h5"
            make_study(path, case, Seeds(seed, seed + 1))
            line["score"] = score(analyse(path, "paper"), case)
    except Exception as error:
        line["error"] = f"{type(error).__name__}: {error}"
    return line | {"seconds": time.perf_counter() - began}


TOLD: Final = ("form", "causes", "right", "covered", "error")


def main() -> None:
    """Go on with a campaign until a time is over."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path, help="file of lines, made or gone on with")
    parser.add_argument("--each", type=int, default=20, help="studies of each kind")
    parser.add_argument("--nulls", type=int, default=100)
    parser.add_argument("--minutes", type=float, default=np.inf, help="none is begun later")
    parser.add_argument("--kind", choices=sorted(DESIGNS), help="of this kind only")
    asked = parser.parse_args()
    done = {line["name"] for line in read(asked.path) if "score" in line}
    counts = {kind: asked.nulls if kind == "null" else asked.each for kind in DESIGNS}
    wanted = sorted(
        (number / count, kind, number)
        for kind, count in counts.items()
        if asked.kind in (None, kind)
        for number in range(count)
    )
    until = time.monotonic() + 60.0 * asked.minutes
    for _, kind, number in wanted:
        if f"{kind}/{number}" in done:
            continue
        if time.monotonic() > until:
            break
        line = run(kind, number, secrets.randbits(31))
        with asked.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        told = line.get("score", line)
        print(line["name"], {k: told.get(k) for k in TOLD}, flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
