"""Measure what the lead costs and write its table: `python bench/lead.py --help`.

On the simulated rig, fused, with its sensors and noise: the same free strokes at every lead, so
that what differs between the rows is the lead. The seeds of the paths are fresh each time, and
in the document.
"""

import argparse
import secrets
import sys
import textwrap
from pathlib import Path as File
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from frictus.recordings import texture_of
from frictus.textures import Texture
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.human import HumanStrokes
from frictus_laboratory.rendering_error import (
    LAW,
    MODES,
    RATE_HZ,
    SCREEN,
    Way,
    judge,
    rendered_errors,
    whole,
)
from frictus_service.fidelity.measure import full_gain
from frictus_service.library import SHIPPED

OUT: Final = File(__file__).parents[1] / "docs" / "lead.md"
LEADS_MS: Final = (2.0, 5.0, 10.0, 15.0, 20.0, 30.0)
PATH_S: Final = 11.0
"""Of which the first second is not judged."""

TEXT: Final = """# What the lead costs

Made by `uv run python bench/lead.py`. A drive plays one lead after it was rendered, and it is
rendered for where the finger is predicted to be by then: the longer the lead, the further the
prediction is off. On the simulated rig, every sensor used, blocks of 5 ms: {paths} paths of
free strokes of 10 s, the same for every lead, all of each path, and {textures} shipped textures
of recordings. *Position*: rms of where the finger was rendered. *Bands*: friction at the screen
against the target at the finger's true position, in third octaves, dB rms as in
[rendering error](fidelity.md), mean of paths and textures. *Beyond the shortest*: the same less
that of the shortest lead on the same path, with its 95 % interval over the paths.

| lead | position | bands | beyond the shortest (95 %) |
|---|---|---|---|
{rows}

With the true state of the finger it is 0.00 dB: all of it is prediction. What a prediction
costs besides the lead, such as the noise of the sensors, is in the first row. `frictus doctor`
says the figure of a rig's lead, and of the least that would do, from this table; a real finger
and real sensors were not measured.

{seeds}
"""


def measure(
    textures: list[Texture], seeds: list[int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean squares of the position, mm², and dB, both of shape (lead, texture, path)."""
    shape = len(LEADS_MS), len(textures), len(seeds)
    squares_mm2, bands_db = np.zeros(shape), np.zeros(shape)
    for number, seed in enumerate(seeds):
        config = SimulatedConfig(finger=HumanStrokes(), seed=seed)
        for column, texture in enumerate(textures):
            scene = full_gain(texture, LAW, SCREEN, RATE_HZ)
            for row, lead_ms in enumerate(LEADS_MS):
                path = Way(f"{lead_ms:g} ms", lead_ms).walk(config, PATH_S, scene)
                squares_mm2[row, column, number] = np.mean(np.square(rendered_errors(path)[0]))
                error = judge(path, texture, LAW, whole(path), MODES[:1])[MODES[0]]
                bands_db[row, column, number] = error.rms_db
        print(f"path {number + 1} of {len(seeds)}", file=sys.stderr)  # noqa: T201 - a script
    return squares_mm2, bands_db


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--paths", type=int, default=10, help="free paths")
    parser.add_argument("--out", type=File, default=OUT, help="markdown file")
    arguments = parser.parse_args()
    files = [path for path in sorted(SHIPPED.glob("*.json")) if path.stem != "flat"]
    textures = [texture_of(path.read_text()) for path in files]
    seeds = [secrets.randbits(32) for _ in range(arguments.paths)]
    squares_mm2, bands_db = measure(textures, seeds)
    rows = []
    for row, lead_ms in enumerate(LEADS_MS):
        position_mm = np.sqrt(np.mean(squares_mm2[row]))
        beyond = np.mean(bands_db[row] - bands_db[0], axis=0)
        half = stats.t.ppf(0.975, len(seeds) - 1) * stats.sem(beyond)
        rows.append(
            f"| {lead_ms:g} ms | {position_mm:.3f} mm | {np.mean(bands_db[row]):.3f} dB "
            f"| {np.mean(beyond):+.3f} [{np.mean(beyond) - half:+.3f}, "
            f"{np.mean(beyond) + half:+.3f}] |"
        )
    text = TEXT.format(
        seeds=textwrap.fill(
            f"Seeds of the paths: {', '.join(str(seed) for seed in seeds)}.", 95
        ),
        paths=len(seeds),
        textures=len(textures),
        rows="\n".join(rows),
    )
    arguments.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
