"""Write a campaign's section of the document: `python -m tests.campaigns.reliability --help`.

Sections are made from the lines that a campaign left; what else stands in the document stays.
"""

import argparse
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from tests.campaigns.lines import Line, read

OUT: Final = Path(__file__).parents[2] / "docs" / "reliability.md"

WIRE: Final = """\
Valid payloads flipped, cut and spliced, with the extremes of every number, other types,
missing fields, depths up to 20,000 and sizes up to and above what is accepted, on every
key that a client may put or ask. A whole service ran: simulated rig (by its virtual
finger: steady strokes, a client's pointer, guided strokes; secured: with certificates),
recorder, which was recording, and API. *disarmed*: nobody armed, and the screen had to
stay at zero; *armed*: the owner had, a stranger and an observer sent, and the rig had to
stay the owner's; *owner*: the owner sent; *free*: all three sent anything. A failure is a
process that ends, a trip, a voltage without owner, a call without a `Reply` that is
accepted or bears a code, an API that does not answer 200, a recording that cannot be
read. *denied*: the router let it pass to nobody, as it should."""
COMMANDS: Final = """\
Made by `uv run python -m tests.campaigns.{campaign} lines.jsonl {options}`, which goes on
where it was stopped, and `uv run python -m tests.campaigns.reliability {campaign}
lines.jsonl`. A batch that failed is made again with its seed; its line holds the
payloads."""


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def with_section(text: str, heading: str, body: str) -> str:
    """Return a document with a section replaced, or added at its end.

    Parameters
    ----------
    text : str
        Markdown.
    heading : str
        Of the section, of the second level.
    body : str
        What shall stand below it.
    """
    section = f"## {heading}\n\n{body.strip()}\n"
    found = re.search(
        rf"^## {re.escape(heading)}\n.*?(?=^## |\Z)", text, re.MULTILINE | re.DOTALL
    )
    if found is None:
        return f"{text.rstrip()}\n\n{section}"
    after = text[found.end() :]
    return text[: found.start()] + section + ("\n" if after else "") + after


def circumstances(lines: Sequence[Line]) -> str:
    """Return when and beside what a campaign ran, in words."""
    seconds = sum(line.get("seconds", 0.0) for line in lines)
    loads = [load for line in lines for load in line["load"] if load is not None]
    beside = f", load {min(loads):.1f} to {max(loads):.1f}" if loads else ""
    machines = "; ".join(sorted({line["machine"] for line in lines}))
    return (
        f"{seconds / 60.0:.0f} min on {machines}{beside}; {len(lines)} batches, each with its "
        "own seed"
    )


def failures(lines: Sequence[Line]) -> str:
    """Return a table of what failed, or that nothing did."""
    rows = [
        [line["name"], str(line["seed"]), failure["what"].replace("|", "/")[:200]]
        for line in lines
        for failure in line["failures"]
    ]
    return table(["batch", "seed", "what"], rows) if rows else "Nothing failed."


def wire(lines: Sequence[Line]) -> str:
    """Return the section of the wire campaign."""
    sent, outcomes = Counter[str](), dict[str, Counter[str]]()
    for line in lines:
        kind = "/".join(line["name"].split("/")[:2])
        sent[kind] += line["cases"]
        outcomes.setdefault(kind, Counter()).update(line.get("outcomes", {}))
    codes = sorted({code for counts in outcomes.values() for code in counts})
    rows = [
        [kind, str(sent[kind]), *(str(counts[code]) for code in codes)]
        for kind, counts in outcomes.items()
    ]
    gigabytes = sum(line.get("bytes", 0) for line in lines) / 1e9
    return (
        f"{sum(sent.values())} payloads ({gigabytes:.1f} GB) in {circumstances(lines)}. "
        f"{WIRE}\n\n"
        f"{table(['service/mode', 'payloads', *codes], rows)}\n\n{failures(lines)}\n\n"
        f"{COMMANDS.format(campaign='wire', options='--cases 50000')}"
    )


SECTIONS: Final[Mapping[str, tuple[str, Callable[[Sequence[Line]], str]]]] = {
    "wire": ("Wire", wire),
}
"""Heading and writer of the section of each campaign."""


def main() -> None:
    """Write a section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("campaign", choices=SECTIONS)
    parser.add_argument("results", type=Path, help="lines of the campaign")
    arguments = parser.parse_args()
    lines = read(arguments.results)
    if not lines:
        raise SystemExit(f"{arguments.results} has no lines; run the campaign first")
    heading, write = SECTIONS[arguments.campaign]
    text = OUT.read_text(encoding="utf-8")
    OUT.write_text(with_section(text, heading, write(lines)), encoding="utf-8")


if __name__ == "__main__":
    main()
