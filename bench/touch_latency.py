"""Write the table of touch latency: `python bench/touch_latency.py --help`.

On a fake NI device, whose clock passes by reads alone: what is counted are samples, not time.
"""

import argparse
import secrets
import sys
from pathlib import Path
from typing import Final

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # so that a script finds the tests

from tests.hardware.nidaq.latency import RATE_HZ, configured, latencies

OUT: Final = Path(__file__).parents[1] / "docs" / "touch_latency.md"
SETTINGS: Final = ((1.0, 15.0), (2.0, 15.0), (5.0, 15.0), (1.0, 30.0), (2.0, 30.0), (5.0, 30.0))
"""Block and lead, ms."""

TEXT: Final = """# From a touch report to a changed output

Made by `uv run python bench/touch_latency.py`, seed {seed}: a finger slides over a
texture, once as it is and {reports} times with one report a little aside; the first
output sample that differs, less the sample at which the report arrived. Samples of the
device's clock at 20 kHz; the backend for NI devices over a fake one. A report waits for
the end of its block, 0 to one block, and then for one lead; rendering adds none. The
sensor's own latency comes before.

| block | lead | samples, least | median | most | ms, median |
| --- | --- | --- | --- | --- | --- |
{rows}

The lead is what a late loop may use up before the output runs dry, less the third that is kept
back so that a stop can ramp it. 15 ms with 1 or 2 ms blocks is for a local driver on a quiet
machine: watch `margin_min_ms` in the rig's status, and raise `lead_ms` where it comes near 0.
"""


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reports", type=int, default=20)
    parser.add_argument("--seed", type=int, default=secrets.randbits(31))
    parser.add_argument("--out", type=Path, default=OUT)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    rows = []
    for block_ms, lead_ms in SETTINGS:
        found = np.array(latencies(configured(block_ms, lead_ms), rng, arguments.reports))
        median = float(np.median(found))
        rows.append(
            f"| {block_ms:g} ms | {lead_ms:g} ms | {found.min()} | {median:g} | {found.max()} "
            f"| {1e3 * median / RATE_HZ:.1f} |"
        )
    text = TEXT.format(seed=arguments.seed, reports=arguments.reports, rows="\n".join(rows))
    arguments.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
