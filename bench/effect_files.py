"""Which effect files of a folder render, and why the others do not.

`uv run python bench/effect_files.py FOLDER [--speed MM/S]`: a line for each file that is none,
with the reason, then how many of each suffix render as a signal in time, and how many are a
texture over time (or, at a speed, over position). Files of the same content count once.
"""

import argparse
import hashlib
import sys
from collections import Counter
from pathlib import Path

from frictus.effect_files import EFFECT_SUFFIXES, render_effect
from frictus.errors import TextureError
from frictus.recordings import import_texture


def main() -> None:
    """Try every file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--speed", type=float, help="in mm/s: textures over position")
    given = parser.parse_args()
    seen: set[bytes] = set()
    files, signals, textures = Counter[str](), Counter[str](), Counter[str]()
    for path in sorted(given.folder.rglob("*")):
        suffix = path.suffix.lower()
        if suffix not in EFFECT_SUFFIXES or not path.is_file():
            continue
        content = path.read_bytes()
        digest = hashlib.sha256(content).digest()
        if digest in seen:
            continue
        seen.add(digest)
        files[suffix] += 1
        try:
            render_effect(content, suffix)
            signals[suffix] += 1
            import_texture(path, given.speed, scale_n=0.5)
            textures[suffix] += 1
        except TextureError as error:
            sys.stdout.write(f"{path.relative_to(given.folder)}: {error}\n")
    for suffix in EFFECT_SUFFIXES:
        sys.stdout.write(
            f"{suffix}: {signals[suffix]} of {files[suffix]} render, "
            f"{textures[suffix]} are textures\n"
        )


if __name__ == "__main__":
    main()
