"""Tables of the campaign of a model that follows its finger, in markdown."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from bench import live_model_verdicts as verdicts
from scipy import stats
from tests.blind.cases import REALISTIC
from tests.campaigns.lines import Line, read
from tests.campaigns.live_model import LEARNED, RIG_STARTS, SIZES, UNKNOWN, code

from frictus_service.tracking.evidence import signatures
from frictus_service.tracking.evidence.watch import MAINS

ROOT: Final = Path(__file__).parents[1]
STUDIES: Final = ROOT / "bench" / "blind.jsonl"


class Sessions:
    """Lines of a campaign of one kind.

    Parameters
    ----------
    lines : iterable of dict
        Of the campaign.
    start : str
        With which their names begin.
    """

    def __init__(self, lines: Iterable[Line], start: str) -> None:
        self.lines = [line for line in lines if f"{line['name']}/".startswith(start)]

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.lines)

    def of(self, value: Callable[[Line], Any]) -> list[Any]:
        """Return a value of each."""
        return [value(line) for line in self.lines]

    def count(self, holds: Callable[[Line], Any]) -> int:
        """Return of how many something holds."""
        return sum(bool(holds(line)) for line in self.lines)


def share(hits: int, of: int) -> str:
    """Return a share with its binomial 95 % interval (Clopper and Pearson)."""
    if not of:
        return "-"
    low, high = stats.binomtest(hits, of).proportion_ci(0.95)
    return f"{100 * hits / of:.0f} % [{100 * low:.0f}, {100 * high:.0f}] ({hits} of {of})"


def quantile(values: Sequence[float | None], at: float, unit: str = " s") -> str:
    """Return a quantile; None is later than any."""
    if not values:
        return "-"
    found = float(
        np.quantile([np.inf if v is None else v for v in values], at, method="higher")
    )
    return f"{found:.1f}{unit}" if np.isfinite(found) else "not reached"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def worst(values: Sequence[float]) -> str:
    """Return the median, 95th percentile and largest of some values, dB."""
    if not values:
        return "-"
    return f"{np.median(values):.3f} ({np.quantile(values, 0.95):.3f}, {max(values):.3f})"


def counted(lines: list[Line]) -> list[Line]:
    """Return the sessions of the present code: those of another are not counted.

    Parameters
    ----------
    lines : list of dict
        Of the campaign, of any code.
    """
    return [line for line in lines if line.get("code") == code()]


def sources(lines: list[Line]) -> str:
    """Return how many sessions there are of each kind."""
    kinds = Counter(line["name"].split("/")[0] for line in lines)
    return table(list(kinds), [[str(count) for count in kinds.values()]])


def learned(lines: list[Line]) -> str:
    """Return how soon the estimate and the model in force render as the true law would."""
    rows = []
    starts = {texture: f"learn/{texture}/" for texture in LEARNED}
    starts |= {"all": "learn/", "all, known motion": "known/"}
    for texture, start in starts.items():
        found = Sessions(lines, start)
        if not len(found):
            continue
        end = found.of(lambda line: line["observe"]["newest_db"])
        rows.append(
            [
                f"{texture}, {len(found)}",
                f"{np.median(found.of(lambda line: line['begins_db'])):.2f}",
                quantile(found.of(lambda line: line["observe"]["newest_within_s"]), 0.5),
                quantile(found.of(lambda line: line["observe"]["newest_within_s"]), 0.9),
                f"{np.median(end):.3f} ({max(end):.3f})",
                quantile(found.of(lambda line: line["in_force_within_s"]), 0.5),
                quantile(found.of(lambda line: line["in_force_within_s"]), 0.9),
                worst(found.of(lambda line: line["in_force_db"])),
            ]
        )
    header = (
        *("texture, sessions", "begins at, dB", "estimate within 0.1 dB, median", "90 %"),
        *("estimate at the end, median (worst), dB", "in force within 0.1 dB, median", "90 %"),
        "in force at the end, median (95 %, worst), dB",
    )
    return table(header, rows)


def coverage(lines: list[Line]) -> str:
    """Return how many of the intervals at the end hold, observed and adapted."""
    rows = []
    kinds = {
        "learn/": "predicted",
        "known/": "known",
        "learn/grating/": "predicted, grating alone",
        "known/grating/": "known, grating alone",
        "steady/": "predicted, at one speed for 60 s",
        "steady/grating/": "predicted, at one speed, grating alone",
        "scatter/": "predicted, strokes differ",
        "scatter/grating/": "predicted, strokes differ, grating alone",
    }
    for start, motion in kinds.items():
        found = Sessions(lines, start)
        if not len(found):
            continue
        told = [(name, "z", number) for number, name in enumerate(verdicts.COORDINATES)]
        if start.startswith("scatter/"):
            told.append(("gain of the person", "z_person", verdicts.COORDINATES.index("gain")))
        for name, of, number in told:
            row = [f"{name}, motion {motion}"]
            for sessions in (found.of(lambda line: line["observe"]), found.lines):
                at = np.array([each[of][number] for each in sessions])
                hits = int(np.sum(np.abs(at) < 1.96))
                row += [share(hits, at.size), f"{at.mean():+.2f} and {at.std():.2f}"]
            rows.append(row)
    deviation = "mean and SD of the deviation, in standard deviations"
    return table(
        ("interval of", "`observe`: holds", deviation, "`adapt`: holds", deviation), rows
    )


NULLS: Final = {
    "exact": "constant",
    "scatter": "scatters within the person",
    "scatter_observe": "the same, observed",
}


def nulls(lines: list[Line]) -> str:
    """Return by how much a model that was right became worse, and the alarms."""
    return _against_the_first(lines, {f"null/{which}/": told for which, told in NULLS.items()})


def turns(lines: list[Line]) -> str:
    """Return how the model in force fares where two people take turns without notice."""
    told = {"right": "the first person's own", "placeholder": "the placeholder"}
    return _against_the_first(lines, {f"turns/{which}/": it for which, it in told.items()})


def _against_the_first(lines: list[Line], kinds: Mapping[str, str]) -> str:
    """Return by how much the model in force was worse than that of the beginning."""
    rows = []
    for kind, told in kinds.items():
        found = Sessions(lines, kind)
        alarms = found.count(lambda line: line["named"])
        rows.append(
            [
                f"{told}, {len(found)}",
                worst(found.of(lambda line: line["excess_db"]["median"])),
                worst(found.of(lambda line: line["excess_db"]["q95"])),
                worst(found.of(lambda line: line["excess_db"]["worst"])),
                f"{100 * np.mean(found.of(lambda line: line['excess_db']['above_0.02'])):.1f} %"
                if len(found)
                else "-",
                f"{np.mean(found.of(lambda line: line['excess_db']['mean'])):+.3f}"
                if len(found)
                else "-",
                str(np.median(found.of(lambda line: len(line["changes"]))))
                if len(found)
                else "-",
                share(alarms, len(found)),
            ]
        )
    header = (
        *("sessions", "median in time", "95 % in time", "worst in time"),
        *("time above 0.02 dB", "mean", "changes", "sessions with an alarm"),
    )
    return table(header, rows)


def followed(lines: list[Line]) -> str:
    """Return how a finger that changes is followed."""
    rows = []
    for kind, told in (("moisture", "gain times 0.8 within 1 s"), ("new_finger", "new finger")):
        found = Sessions(lines, f"{kind}/")
        noticed = found.of(_noticed)
        within = sum(at is not None and at <= 10.0 for at in noticed)
        rows.append(
            [
                f"{told}, {len(found)}",
                worst(found.of(lambda line: line["followed"]["step_db"])),
                quantile(found.of(lambda line: line["followed"]["newest_s"]), 0.5),
                quantile(found.of(lambda line: line["followed"]["newest_s"]), 0.9),
                quantile(found.of(lambda line: line["followed"]["in_force_s"]), 0.5),
                quantile(found.of(lambda line: line["followed"]["in_force_s"]), 0.9),
                share(within, len(found)),
                quantile(noticed, 0.5),
            ]
        )
    header = (
        *("change, sessions", "error if not followed, median (95 %, worst), dB"),
        *("estimate, 90 % of the step: median", "90 % of sessions"),
        *("in force, 90 % of the step: median", "90 % of sessions"),
        *("noticed within 10 s", "median"),
    )
    return table(header, rows)


def _noticed(line: Line) -> float | None:
    """Return how long after its change a new finger or an alarm is noticed, s."""
    times = [*line["new_fingers"], *line["named"].values()]
    after = [at - 30.0 for at in times if at > 30.0]
    return min(after, default=None)


def drifts(lines: list[Line]) -> str:
    """Return how a drift is followed."""
    found = Sessions(lines, "drift/")
    rows = []
    for of, told in (
        ("newest_db", "estimate"),
        ("in_force_db", "model in force"),
        ("first_db", "if not followed"),
    ):
        median, most = np.array([line["followed"][of] for line in found.lines]).T
        rows.append([told, f"{np.median(median):.3f}", f"{max(most):.3f}"])
    head = f"5 minutes each, {len(found)}"
    return table((head, "error after the first minute, median, dB", "worst"), rows)


def causes(lines: list[Line]) -> str:
    """Return which causes are named."""
    rows = []
    by_discover = Counter(
        line["task"]["which"] for line in read(STUDIES) if _found_by_discover(line)
    )
    ids = sorted({line["name"].split("/")[1] for line in Sessions(lines, "cause/").lines})
    for id_ in ids:
        realistic = next(iter(REALISTIC[id_].values()))
        row = [f"{id_}, {realistic:g} ({_tolerated(id_)})"]
        for size in SIZES:
            row += _named(Sessions(lines, f"cause/{id_}/{size}/"), WATCHED_AS.get(id_, id_))
        found = Sessions(lines, f"cause/{id_}/")
        rows.append([*row, *_discovered(found, id_), f"{by_discover[id_]} of 10"])
    for id_ in UNKNOWN:
        row = [f"{id_} (unknown)", *_named(Sessions(lines, f"unknown/{id_}/"), "unknown")]
        after = _discovered(Sessions(lines, f"unknown/{id_}/"), id_)
        rows.append([*row, "", "", "", *after, f"{by_discover[id_]} of 10"])
    header = ["cause, its size 1 (and what is tolerated)"]
    for size in SIZES:
        header += [f"size {size}: named", "median time", "other alarms"]
    header += ["`discover` on the same sessions: named", "other causes"]
    return table([*header, "`discover`, a study of 12 people at size 1"], rows)


def _discovered(found: Sessions, id_: str) -> list[str]:
    """Return in how many sessions a cause ranks first afterwards, and what else does."""
    ranked = [line["discovered"] for line in found.lines if "discovered" in line]
    others = Counter(name for names in ranked for name in names if name != id_)
    told = ", ".join(f"{name} {count}" for name, count in others.most_common(3))
    named = sum(id_ in names for names in ranked)
    return [f"{named} of {len(ranked)}" if ranked else "-", told or "-"]


WATCHED_AS: Final = {"channel_delay": "delay"}


def _tolerated(id_: str) -> str:
    """Return up to which size the watch raises no alarm."""
    watched = signatures.SIZES | dict(
        zip(signatures.LAW_CAUSES, signatures.LAW_SIZES, strict=True)
    )
    size = watched.get(WATCHED_AS.get(id_, id_))
    if size is not None:
        return f"{size.tolerated:g}"
    return "any line" if id_ == MAINS else "not watched"


def _found_by_discover(line: Line) -> bool:
    if line["task"]["kind"] == "single":
        return line["task"]["which"] in line.get("score", {}).get("found", {})
    return bool(line["task"]["kind"] == "unknown" and line.get("score", {}).get("flagged"))


def _named(found: Sessions, id_: str) -> list[str]:
    times = [line["named"][id_] for line in found.lines if id_ in line["named"]]
    others = Counter(name for line in found.lines for name in line["named"] if name != id_)
    told = ", ".join(f"{name} {count}" for name, count in others.most_common(3))
    return [f"{len(times)} of {len(found)}", quantile(times, 0.5), told or "-"]


def harm(lines: list[Line], kind: str, ids: Iterable[str]) -> str:
    """Return what becomes of the model in force where the rig is wrong."""
    rows = []
    for id_ in ids:
        for start in RIG_STARTS:
            found = Sessions(lines, f"{kind}/{id_}/{start}/")
            if not len(found):
                continue
            rows.append(
                [
                    f"{id_}, {start}, {len(found)}",
                    f"{sum(found.of(lambda line: len(line['changes'])))}",
                    worst(found.of(lambda line: line["first_db"])),
                    worst(found.of(lambda line: line["in_force_db"])),
                    f"{max(found.of(lambda line: line['excess_db']['worst'])):+.3f}",
                    _reasons(found, "refused"),
                    _reasons(found, "held"),
                ]
            )
    header = (
        *("what is wrong, model at the beginning, sessions", "changes"),
        *("error of the first model, dB", "of the model in force after 60 s"),
        *("worst against the first, dB", "windows refused", "why the model stayed"),
    )
    return table(header, rows)


USUAL: Final = ("slower than", "the speed changes", "the model in force fits", "gain and")


def _reasons(found: Sessions, of: str) -> str:
    """Return the most frequent reasons but those of every session."""
    total: Counter[str] = Counter()
    for line in found.lines:
        total.update(line[of])
    every = [why for why, _ in total.most_common()]
    told = [why for why in every if not why.startswith(USUAL)] or every[:1]
    return "; ".join(why.split(":")[0] for why in told[:2]) or "-"


def cost(lines: list[Line]) -> str:
    """Return the processor time of the arithmetic, as a share of the session's time."""
    each = [100.0 * line["arithmetic_s"] / line["seconds"] for line in lines]
    seconds = sum(line["seconds"] for line in lines)
    total = sum(line["arithmetic_s"] for line in lines) / seconds
    return (
        f"{100 * total:.2f} % of a core over {seconds / 3600:.1f} h of sessions; the dearest "
        f"session {max(each):.2f} %"
    )
