"""Write the catalogue of causes as a document: `python bench/causes.py --help`."""

import argparse
from pathlib import Path

from frictus_service.discovery.catalogue.page import catalogue


def main() -> None:
    """Write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="markdown file")
    parser.parse_args().out.write_text(catalogue(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
