"""Write a campaign's section of the document: `python -m tests.campaigns.reliability --help`.

Sections are made from the lines that a campaign left; what else stands in the document stays.
"""

import argparse
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Final

import numpy as np
from tests.campaigns.lines import Line, read
from tests.campaigns.soak import slope

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
KILLS: Final = """\
Processes of a whole service (supervisor with router, rig, API, recorder) and its client
are sent SIGKILL or SIGSTOP (for 1.5 s), one or two at once, at a random moment, while the
client streams a texture at 5 Hz, everything is recorded and models are published. The
device is a process that nobody kills and that holds its last value, as a real one does;
*zero* is its last driven sample, *again* when it is driven once more. A failure is a
screen that is driven for longer than lease (300 ms), freeze limit (250 ms) and 100 ms
together, a published model that is gone, a recording that ends more than 1.5 s before the
attack, a part that does not come back or outlives its supervisor. Rig and supervisor at
once are left out: nobody is left to reset the device, which is what the interlock line is
for ([Safety](safety.md))."""
STARTS: Final = """\
`frictus serve` on a folder in which a service has worked, after something was done to it.
It must serve, so that a client can arm, or end with a sentence and a code of its own, and
start once the fault is gone. *Torn* files are cut, emptied, zeroed or have bits flipped,
at random. Where nothing can be written, the recorder must say so and the API answer 503
or 507, while the rig goes on; where UTC steps by an hour either way under an armed rig,
its owner loses the lease and can arm again once the clocks agree; two services in one
folder must both be able to publish."""
SOAK: Final = """\
One rig at 20 kHz, subscribers that follow four streams, viewers of the dashboard who ask
for 60 frames/s of three, a texture streamed at 5 Hz, a recording begun and ended in each
window; quiet, or beside processes that keep a core busy each. Loss is of the blocks that
a subscriber, or a recording, should have got; the first window is for settling. A quiet
soak fails where subscribers lose more than 1e-4, a deadline is missed, a block dropped or
the loop's lateness exceeds 1 ms at p99."""
LINKS: Final = """\
A proxy between a client and the rig's router delays, loses, throttles, stalls or breaks
the connection, each direction alike; TCP hides a lost segment, what follows waits until it
is sent again (200 ms and a round trip). The client streams a texture at 5 Hz with a lease
of 1 s, another reads the force; *age* is of a block's last sample when it is read. The
device is a process of its own that holds its last value; *zero* counts from the stall or
cut to its last driven sample, *again* from its end until the client drives once more. A
failure is a trip (unless the machine itself is late for 5 s), a screen that is driven for
longer than the lease, the lead (100 ms here) and 100 ms together, a client that does not
come back, and, without losses and within the link's capacity, a block or a lease that is
lost."""
SITE: Final = """\
Rigs that play a recording (`replay`), each with supervisor, recorder and an owner who streams
at 5 Hz, on two linked routers; two APIs on one PostgreSQL behind nginx; subscribers at the
router that their rig does not use; viewers of three streams at 60 frames/s. A ladder ends at
the first size in which something gives: viewers get less than 90 % of their frames, or frames
older than 250 ms, recordings or subscribers (1e-4) miss blocks, a loop is 5 ms late at p99, a
rig drops blocks, trips, is silent or ends. That is what a site is [sized](sizing.md) by, not a
failure; one is a model that is published by the proxy and not found at each API, or a site
that does not start."""
COMPILED: Final = """\
Properties of compiled code over all numbers that may reach it, their extremes included,
drawn by hypothesis with a fresh seed for each batch, with indices checked
(`NUMBA_BOUNDSCHECK=1`). Those of `test_plain.py` make each call that Python makes of a
compiled function twice, as it is and as the same lines of plain Python on numpy, and
compare what comes of it (1e-9 of the largest value)."""
REST: Final = """\
schemathesis, with all its checks and phases (coverage, examples, fuzzing, stateful), sends
what `/openapi.json` allows and what it forbids, without a token and with one of each scope,
to a whole service: simulated rig, recorder, API, a model in the registry. A failure is a
status that is not documented, a 5xx but a typed 503 or 504, an answer that is not as
documented or takes more than 10 s, what the reference forbids and the API accepts, or allows
and the API refuses. Bodies may be refused with 422 besides, for rules between fields, which
JSON Schema does not state; a precondition with 412 and 428. Then come clients that harm by
how they send and read; beside them health must answer within 5 s, and afterwards memory and
descriptors be what they were, but for 100 MB and for the kept connections to the database.
After each batch health and readiness must be 200, no process have ended, and the rig not have
tripped."""
COMMANDS: Final = """\
Made by `uv run python -m tests.campaigns.{campaign} lines.jsonl {options}`, which goes on
where it was stopped, and `uv run python -m tests.campaigns.reliability {campaign}
lines.jsonl`. A batch that failed is made again with its seed; its line holds
what was sent or done."""


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


def kills(lines: Sequence[Line]) -> str:
    """Return the section of the kills."""
    kinds: dict[str, list[Line]] = {}
    for line in lines:
        attack = line["attack"]
        kinds.setdefault("two at once" if " + " in attack else attack, []).append(line)
    rows = [
        [
            kind,
            str(len(of_kind)),
            _spread([line["zero_ms"] for line in of_kind if line.get("zero_ms") is not None]),
            _spread([line["again_s"] for line in of_kind if "again_s" in line]),
            str(sum(bool(line["failures"]) for line in of_kind)),
        ]
        for kind, of_kind in sorted(kinds.items())
    ]
    header = ["attack", "count", "zero, ms: median, worst", "again, s: median, worst", "failed"]
    models = sum(line.get("published", 0) for line in lines)
    return (
        f"{len(lines)} attacks, {models} models published, in {circumstances(lines)}. "
        f"{KILLS}\n\n"
        f"{table(header, rows)}\n\n{failures(lines)}\n\n"
        f"{COMMANDS.format(campaign='kills', options='--attacks 200')}"
    )


def _spread(values: Sequence[float]) -> str:
    return f"{median(values):.3g}, {max(values):.3g}" if values else "-"


def starts(lines: Sequence[Line]) -> str:
    """Return the section of the starts."""
    faults: dict[str, list[Line]] = {}
    for line in lines:
        faults.setdefault(line["name"].rsplit("/", 1)[0], []).append(line)
    rows = []
    for fault, of_fault in faults.items():
        came = Counter(line["came"].split(":")[0] for line in of_fault)
        failed = sum(bool(line["failures"]) for line in of_fault)
        told = ", ".join(f"{how} {count}" for how, count in sorted(came.items()))
        rows.append([fault, str(len(of_fault)), told, str(failed)])
    return (
        f"{len(lines)} starts in {circumstances(lines)}. {STARTS}\n\n"
        f"{table(['fault', 'starts', 'what came (exit code)', 'failed'], rows)}\n\n"
        f"{failures(lines)}\n\n{COMMANDS.format(campaign='starts', options='--repeats 5')}"
    )


def links(lines: Sequence[Line]) -> str:
    """Return the section of the bad links."""
    conditions: dict[str, list[Line]] = {}
    for line in lines:
        conditions.setdefault(line["name"].rsplit("/", 1)[0], []).append(line)
    steady, broken = [], []
    for condition, of_one in conditions.items():
        failed = str(sum(bool(line["failures"]) for line in of_one))
        of_one = [line for line in of_one if len(line) > 5]  # the others told nothing
        if not of_one:
            continue
        if "again_s" in of_one[0]:
            zeros = [line["zero_ms"] for line in of_one if line["zero_ms"] is not None]
            again = _spread([line["again_s"] for line in of_one])
            broken.append([condition, str(len(of_one)), _spread(zeros), again, failed])
            continue
        ages = [median(line["age_ms"][place] for line in of_one) for place in (0, 1)]
        missing = sum(line["missing"] for line in of_one)
        steady.append(
            [
                condition,
                str(len(of_one)),
                f"{ages[0]:.3g}, {ages[1]:.3g}",
                f"{missing} of {missing + sum(line['blocks'] for line in of_one)}",
                f"{median(line['updates_hz'] for line in of_one):.1f}",
                str(sum(line["lease_lost"] for line in of_one)),
                failed,
            ]
        )
    of_steady = ["link", "runs", "age, ms: median, p99", "blocks missing", "updates/s"]
    of_steady += ["leases lost", "failed"]
    of_broken = ["link", "runs", "zero, ms: median, worst", "again, s: median, worst", "failed"]
    return (
        f"{circumstances(lines)}. {LINKS}\n\n{table(of_steady, steady)}\n\n"
        f"{table(of_broken, broken)}\n\n{failures(lines)}\n\n"
        f"{COMMANDS.format(campaign='links', options='--repeats 3')}"
    )


def compiled(lines: Sequence[Line]) -> str:
    """Return the section of compiled code."""
    counts = Counter[str]()
    for line in lines:
        counts.update(line["examples"])
    rows = [[f"`{name}`", str(count)] for name, count in sorted(counts.items())]
    return (
        f"{sum(counts.values())} examples in {circumstances(lines)}. {COMPILED}\n\n"
        f"{table(['property', 'examples'], rows)}\n\n{failures(lines)}\n\n"
        f"{COMMANDS.format(campaign='compiled', options='--batches 20')}"
    )


def soak(lines: Sequence[Line]) -> str:
    """Return the section of the soaks."""
    lost_rows, slope_rows = [], []
    for line in lines:
        windows = line["windows"][1:]
        received, lost, recorder = (
            sum(window[name] for window in windows)
            for name in ("received", "lost", "recorder_lost")
        )
        counted = Counter[str]()
        for window in windows:
            counted.update(window["counted"])
        frames = median(window["frames_hz"] for window in windows)
        late = [window["lateness_p99_ms"] for window in windows]
        updates = counted.pop("stream_updates", 0)
        lost_rows.append(
            [
                f"{line['name']}: {line['subscribers']} subscribers, {line['viewers']} viewers",
                f"{lost} of {received + lost}",
                str(recorder),
                f"{frames:.1f}",
                f"{updates}",
                f"{median(late):.2f}, {max(late):.2f}",
                ", ".join(f"{name} {count}" for name, count in counted.items() if count) or "-",
            ]
        )
        hours = np.array([window["end_s"] / 3_600.0 for window in windows])
        for part in windows[0]["memory_mb"] if len(windows) > 2 else ():
            cells = [line["name"], part]
            for what in ("memory_mb", "descriptors"):
                values = np.array([float(window[what][part]) for window in windows])
                rise, half = slope(hours, values)
                cells.append(f"{values[-1]:.0f}, {rise:+.1f} ± {half:.1f}")
            slope_rows.append(cells)
    header = ["soak", "blocks lost", "by recordings", "frames/s", "updates"]
    header += ["lateness p99, ms: median, worst", "counted by the rig"]
    of_slopes = ["soak", "process", "memory, MB: last, per hour", "descriptors: last, per hour"]
    return (
        f"{circumstances(lines)}. {SOAK}\n\n{table(header, lost_rows)}\n\n"
        f"{table(of_slopes, slope_rows)}\n\n{failures(lines)}\n\n"
        f"{COMMANDS.format(campaign='soak', options='--seconds 3600 [--beside CORES]')}"
    )


def site(lines: Sequence[Line]) -> str:
    """Return the section of the sites."""
    ladders: dict[str, list[Line]] = {}
    for line in lines:
        ladders.setdefault(line["name"].split("/")[0], []).append(line)
    rows = []
    for ladder, of_ladder in ladders.items():
        held = [line["name"].partition("/")[2] for line in of_ladder if not line["gave"]]
        full = [line for line in of_ladder if line["gave"]][-1:]
        first = full[0]["name"].partition("/")[2] if full else "none"
        told = "; ".join(full[0]["gave"])[:300] if full else ""
        rows.append([ladder, held[-1] if held else "none", first, told])
    return (
        f"{len(lines)} sizes in {circumstances(lines)}.\n{SITE}\n\n"
        f"{table(['ladder', 'largest that held', 'first that gave', 'what gave'], rows)}\n\n"
        f"{failures(lines)}\n\n{COMMANDS.format(campaign='site', options='--seconds 25')}"
    )


def rest(lines: Sequence[Line]) -> str:
    """Return the section of REST and WebSocket."""
    hostile = [line for line in lines if line["name"].startswith("hostile/")]
    drawn = [line for line in lines if line not in hostile]
    requests, outcomes = Counter[str](), dict[str, Counter[str]]()
    for line in drawn:
        scope = line["name"].split("/")[0]
        requests[scope] += line["cases"]
        outcomes.setdefault(scope, Counter()).update(line["outcomes"])
    codes = sorted({code for counts in outcomes.values() for code in counts})
    rows = [
        [scope, str(requests[scope]), *(str(counts[code]) for code in codes)]
        for scope, counts in outcomes.items()
    ]
    harm = [
        [
            line["name"].partition("/")[2],
            ", ".join(f"{what} {count}" for what, count in sorted(line["outcomes"].items())),
            f"{1e3 * line['health_s']:.0f}",
            *(
                ", ".join(f"{usage[what]:.0f}" for usage in line["usage"])
                for what in ("memory_mb", "descriptors")
            ),
        ]
        for line in hostile
    ]
    header = ["clients", "what came of it", "slowest health, ms"]
    header += ["memory, MB: before, beside, after", "descriptors: the same"]
    return (
        f"{sum(requests.values())} cases in {circumstances(lines)}. {REST}\n\n"
        f"{table(['scope', 'cases', *codes], rows)}\n\n{table(header, harm)}\n\n"
        f"{failures(lines)}\n\n"
        f"{COMMANDS.format(campaign='rest', options='--cases 10000')}"
    )


SECTIONS: Final[Mapping[str, tuple[str, Callable[[Sequence[Line]], str]]]] = {
    "wire": ("Wire", wire),
    "rest": ("REST and WebSocket", rest),
    "kills": ("Kills and freezes", kills),
    "starts": ("Starts", starts),
    "links": ("Bad links", links),
    "compiled": ("Compiled code", compiled),
    "soak": ("Soak", soak),
    "site": ("A site", site),
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
