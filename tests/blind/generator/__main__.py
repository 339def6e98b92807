"""Write a study with something hidden: `python -m tests.blind.generator --help`."""

import argparse
import json
import secrets
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from tests.blind.cases import KINDS, cause, draw_case
from tests.blind.generator.case import Case, Design
from tests.blind.generator.study import Seeds, make_study


def main() -> None:
    """Write the study and print the truth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path, help="file to write")
    parser.add_argument("--case", choices=sorted(KINDS), default="null")
    parser.add_argument("--cause", default="", help="which of the case; drawn if not given")
    parser.add_argument("--size", type=float, help="times the realistic size; of --cause alone")
    parser.add_argument("--seed", type=int, default=secrets.randbits(31))
    parser.add_argument("--fresh", type=int, default=0, help="same people, other trials")
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--participants", type=int, default=12)
    parser.add_argument("--base", choices=["paper", "constant_cutoff"], default="paper")
    parser.add_argument("--tones-per-trial", type=int, choices=[1, 3], default=1)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    names, _ = KINDS[arguments.case]
    which = arguments.cause or str(rng.choice(names))
    if arguments.size is None:
        case = draw_case(arguments.case, which, rng, arguments.seconds)
    else:
        hidden = cause(which, arguments.size, rng)
        case = Case(arguments.case, (hidden,), Design(seconds=arguments.seconds))
    design = replace(
        case.design,
        participants=arguments.participants,
        base=arguments.base,
        tones_per_trial=arguments.tones_per_trial,
    )
    case = replace(case, design=design)
    seeds = Seeds(arguments.seed, arguments.seed + 1 + arguments.fresh)
    told = make_study(arguments.path, case, seeds)
    print(json.dumps({"case": asdict(case), "seeds": asdict(seeds), **told}, indent=1))  # noqa: T201


if __name__ == "__main__":
    main()
