"""Rates over a campaign, and the bounds that they must keep."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from scipy import stats
from tests.blind.cases import REALISTIC

Line = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Rate:
    """So many of so many, and what is asked of that.

    Attributes
    ----------
    what : str
    hits, of : int
    least, most : float or None
        Bounds of the share.
    chance : bool
        Whether the bound is one of the long run, which the count must not refute at 5 %
        one-sided; else the count itself must keep it.
    """

    what: str
    hits: int
    of: int
    least: float | None = None
    most: float | None = None
    chance: bool = False

    @property
    def share(self) -> float:
        """Hits by number; NaN where there is none."""
        return self.hits / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Of the long run, 95 %, by Clopper and Pearson."""
        low = stats.beta.ppf(0.025, self.hits, self.of - self.hits + 1) if self.hits else 0.0
        misses = self.of - self.hits
        high = stats.beta.ppf(0.975, self.hits + 1, misses) if misses else 1.0
        return float(low), float(high)

    @property
    def kept(self) -> bool:
        """Whether the bounds are kept; never where nothing was counted."""
        if not self.of:
            return False
        if not self.chance:
            return (
                (self.least or 0.0) <= self.share <= (1.0 if self.most is None else self.most)
            )
        above = self.most is None or stats.binom.sf(self.hits - 1, self.of, self.most) > 0.05
        below = self.least is None or stats.binom.cdf(self.hits, self.of, self.least) > 0.05
        return bool(above and below)


def rates(lines: Iterable[Line]) -> list[Rate]:
    """Return what a campaign measured, each against its bound.

    Parameters
    ----------
    lines : iterable of mapping
        Of `tests.blind.campaign`, those that ended in an error too.
    """
    every = list(lines)
    scored = [line for line in every if "score" in line]

    def of(kind: str) -> list[Line]:
        return [line for line in scored if line["task"]["kind"] == kind]

    return [
        Rate("analysed without an error", len(scored), len(every), least=1.0),
        *_nulls(of("null")),
        *_singles(of("single")),
        _count("both of a pair found", of("pair"), _all_found, least=0.90),
        *_unknown(of("unknown")),
        _count(
            "another functional form: family named and flagged",
            of("other_form"),
            lambda line: "family" in line["score"]["found"].values(),
            least=0.90,
        ),
        _count(
            "cannot be told apart: said so, the truth among them",
            of("cannot_tell"),
            lambda line: "cannot_tell" in line["score"]["found"].values(),
            least=0.90,
        ),
        *_paper(of("paper")),
        *_mount(of("mount_moved")),
        *_hidden_or_not("noise", "speed_dependent_cutoff", of("noise"), 0.80),
        *_skins(of("skin")),
        # No design of theirs tells a delay from a roll-off: `one_recording` counts intervals.
        _count("early: channel_delay found", of("early"), _all_found, least=0.80),
        *_lifelike(of("lifelike")),
        *_faulty(of("faulty")),
        _coverage([*of("single"), *of("pair")]),
        *_gains(of("single"), of("pair")),
    ]


def _count(
    what: str,
    lines: Sequence[Line],
    is_hit: Callable[[Line], bool],
    least: float | None = None,
    most: float | None = None,
    chance: bool = False,
) -> Rate:
    return Rate(what, sum(map(is_hit, lines)), len(lines), least, most, chance)


def _all_found(line: Line) -> bool:
    return all(line["score"]["found"].values())


def _is_clean(line: Line) -> bool:
    return bool(line["score"]["verdict"] == "clean")


def _accuses(line: Line) -> bool:
    """Return whether something is named that is not there, alone or in a pair."""
    return bool(line["score"]["false"] or line["score"]["false_pairs"])


def _is_sure_and_wrong(line: Line) -> bool:
    return "confirmed" in line["score"]["false"].values()


def _nulls(lines: Sequence[Line]) -> list[Rate]:
    return [
        _count("null: a cause named", lines, _accuses, most=0.05, chance=True),
        _count("null: clean", lines, _is_clean, least=0.90),
    ]


def _singles(lines: Sequence[Line]) -> list[Rate]:
    named = [
        _count(
            f"single: {name} found",
            [line for line in lines if line["task"]["which"] == name],
            _all_found,
            least=0.80,
        )
        for name in REALISTIC
    ]
    return [
        _count("single: found", lines, _all_found, least=0.95),
        *named,
        _count("single: another cause confirmed besides", lines, _is_sure_and_wrong),
        _count("single: exactly the truth", lines, _is_exact),
    ]


def _is_exact(line: Line) -> bool:
    score = line["score"]
    rest = score["flagged"] or "family" in score["found"].values()
    return _all_found(line) and not _accuses(line) and not rest


def _is_not_explained(line: Line) -> bool:
    """Return whether the verdict says more than that causes of the catalogue explain it all.

    What a form characterises is not among what is left, which `flagged` and `located` count.
    """
    return line["score"]["verdict"] in ("unexplained", "characterised", "partly_explained")


def _unknown(lines: Sequence[Line]) -> list[Rate]:
    modes = [line for line in lines if line["task"]["which"] == "hidden_mode"]
    return [
        _count("unknown: not called explained", lines, _is_not_explained),
        _count("unknown: flagged", lines, lambda line: line["score"]["flagged"], least=0.95),
        _count("unknown: located", lines, lambda line: line["score"]["located"], least=0.95),
        _count(
            "unknown: located, or characterised by its own form",
            [line for line in lines if "formed" in line["score"]],  # lines of later code
            lambda line: line["score"]["located"] or line["score"]["formed"],
            least=0.95,
        ),
        _count("unknown: a false cause confirmed", lines, _is_sure_and_wrong, most=0.10),
        _count("hidden mode: a false cause confirmed", modes, _is_sure_and_wrong, most=0.10),
    ]


def _paper(lines: Sequence[Line]) -> list[Rate]:
    return [
        _count("paper: speed_dependent_cutoff found", lines, _all_found, least=1.0),
        _count(
            "paper: force_dependent_cutoff named",
            lines,
            lambda line: "force_dependent_cutoff" in line["score"]["false"],
            most=0.0,
        ),
    ]


def _mount(lines: Sequence[Line]) -> list[Rate]:
    moved = [line for line in lines if line["task"]["which"] == "moved"]
    other = [line for line in lines if line["task"]["which"] == "other"]
    return [
        _count("mount at 1636 Hz: mount_resonance_shift named", moved, _all_found, least=1.0),
        _count("another mount: a cause confirmed", other, _is_sure_and_wrong, most=0.0),
        _count("another mount: flagged", other, lambda x: x["score"]["flagged"], least=1.0),
    ]


def _hidden_or_not(kind: str, cause: str, lines: Sequence[Line], least: float) -> list[Rate]:
    """Return how studies are judged that hide one cause, or nothing."""
    nothing = [line for line in lines if not line["task"]["which"]]
    hidden = [line for line in lines if line["task"]["which"]]
    return [
        _count(f"{kind}, null: a cause named", nothing, _accuses, most=0.05, chance=True),
        _count(f"{kind}: {cause} found", hidden, _all_found, least=least),
        _count(f"{kind}: exactly the truth", hidden, _is_exact),
    ]


def _skins(lines: Sequence[Line]) -> list[Rate]:
    modes = [line for line in lines if line["task"]["which"]]
    return [
        *_hidden_or_not("skin", "second_mode", lines, 0.95),
        *(
            _held(f"skin: 95 % intervals of the {what} hold the truth", modes, of)
            for what, of in (
                ("share", "second_mode"),
                ("frequency", "second_mode.frequency_hz"),
                ("quality", "second_mode.quality"),
            )
        ),
    ]


def _lifelike(lines: Sequence[Line]) -> list[Rate]:
    """Return how studies are judged that are run less well than the others."""
    held = _covered(lines)
    return [
        *_hidden_or_not("lifelike", "the cause", lines, 0.95),
        _count("lifelike: a cause confirmed that is not there", lines, _is_sure_and_wrong),
        Rate(
            "lifelike: 95 % intervals hold the truth",
            sum(held),
            len(held),
            least=0.90,
            chance=True,
        ),
    ]


def _faulty(lines: Sequence[Line]) -> list[Rate]:
    """Return how studies are judged of a rig with a fault that is none of the causes."""
    nothing = [line for line in lines if not line["case"]["hidden"]]
    hidden = [line for line in lines if line["case"]["hidden"]]
    return [
        _count("faulty rig, null: a cause named", nothing, _accuses, most=0.05, chance=True),
        _count("faulty rig, null: clean", nothing, _is_clean, least=0.90, chance=True),
        _count("faulty rig: the cause found", hidden, _all_found),
        _count("faulty rig: a cause confirmed that is not there", lines, _is_sure_and_wrong),
    ]


def _held(what: str, lines: Sequence[Line], parameter: str) -> Rate:
    """Return how many intervals hold the truth; nine of ten at least, in the long run.

    No bound above: half of what measuring is accurate by is in the intervals of a mode's
    frequency and quality, and simulated sensors are better than that.
    """
    held = [each[parameter] for x in lines if parameter in (each := x["score"]["covered"])]
    return Rate(what, sum(held), len(held), least=0.90, chance=True)


def _covered(lines: Sequence[Line]) -> list[bool]:
    return [hit for line in lines for hit in line["score"]["covered"].values()]


def _coverage(lines: Sequence[Line]) -> Rate:
    covered = _covered(lines)
    return Rate("95 % intervals hold the truth", sum(covered), len(covered), 0.90, 0.98)


def _gains(singles: Sequence[Line], pairs: Sequence[Line]) -> list[Rate]:
    named = [line for line in (*singles, *pairs) if line["score"]["heldout_loglik"] is not None]
    fresh = [line for line in singles if "fresh" in line]
    # A model is not extended by what cannot be told from something else.
    extended = [line for line in fresh if line["score"]["heldout_loglik"] is not None]
    return [
        _count(
            "held-out gain is positive where a cause is named",
            named,
            lambda line: line["score"]["heldout_loglik"] > 0.0,
            least=1.0,
        ),
        _count(
            "fresh data: the extended model is closer than the base model",
            extended,
            lambda line: line["fresh"]["extended"] < line["fresh"]["base"],
            least=0.95,
        ),
        _count(
            "fresh data: no extended model, since causes cannot be told apart",
            fresh,
            lambda line: line["score"]["heldout_loglik"] is None,
        ),
    ]


LEAST_INTERVALS: Final = 200
