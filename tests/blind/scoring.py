"""What a report is worth, against the truth: from `report.json` and nothing else."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from tests.blind.generator.case import Case, Hidden
from tests.blind.generator.people import SLOPE_HZ_PER_MM_S

OF_PAPER: Final = Hidden("speed_dependent_cutoff", {"slope_hz_per_mm_s": SLOPE_HZ_PER_MM_S})
"""What the paper's law is to a base model of constant cutoff."""

WHERE: Final[Mapping[str, tuple[tuple[float, float] | None, frozenset[str]]]] = {
    "hidden_mode": ((160.0, 203.0), frozenset({"none", "tone"})),
    "fast_notch": ((380.0, 660.0), frozenset({"speed"})),
    "speed_times_force": (None, frozenset({"speed x force"})),
    "gain_step": (None, frozenset({"minutes", "order", "time"})),
    "other_mount": (None, frozenset({"none", "tone"})),
}
"""Band (None: all tones) and covariate of what no catalogue has."""

FORM_OF: Final[Mapping[str, str]] = {
    "hidden_mode": "extra_resonance",
    "fast_notch": "extra_resonance",
    "speed_times_force": "gain_coupling_of_speed_and_force",
    "gain_step": "gain_switch_by_time",
}
"""Which form of the grammar is that of what no catalogue has."""


@dataclass(frozen=True, slots=True)
class Score:
    """What one report got right.

    Attributes
    ----------
    verdict : str
        The report's.
    truth : tuple of str
        Causes of the catalogue that were hidden.
    found : dict
        By true cause: "confirmed", "family", "cannot_tell" or "".
    false : dict
        Causes that were named and are not there, with their verdict.
    false_pairs : list
        Of `cannot_tell`, those that hold no true cause.
    covered : dict
        By true cause of the catalogue's form that was named: whether the interval of its first
        parameter holds the truth; by `cause.parameter` of others that have an interval.
    estimates : dict
        The same: truth, estimate, both ends of the interval.
    located : bool or None
        Of an unknown effect: whether its covariate is named and at least half its tones are.
    flagged : bool
        Whether something is said to remain unexplained.
    formed : bool or None
        Of an unknown effect: whether its own form characterises it.
    heldout_loglik : float or None
        Gain of all causes together.
    explained_share : float or None
    """

    verdict: str | None
    truth: tuple[str, ...]
    found: dict[str, str]
    false: dict[str, str]
    false_pairs: list[list[str]]
    covered: dict[str, bool]
    estimates: dict[str, list[float]]
    located: bool | None
    flagged: bool
    formed: bool | None
    heldout_loglik: float | None
    explained_share: float | None

    def as_json(self) -> dict[str, Any]:
        """Return the score as JSON holds it."""
        return asdict(self)


def score(report: Mapping[str, Any], case: Case, tones_hz: Iterable[float]) -> Score:
    """Return the score of a report.

    Parameters
    ----------
    report : mapping
        A `discovery/1` document.
    case : Case
    tones_hz : iterable of float
        Of the study.
    """
    hidden = {each.name: each for each in known(case)}
    named = {cause["id"]: cause for cause in report["causes"]}
    pairs = [list(pair["between"]) for pair in report["cannot_tell"]]
    unknown = [each.name for each in case.hidden if each.form == "unknown"]
    estimates = _estimates(hidden, named)
    gain = report["gain"]
    return Score(
        verdict=report["verdict"],
        truth=tuple(hidden),
        found={name: _found(name, named, pairs) for name in hidden},
        false={name: named[name]["verdict"] for name in named if name not in hidden},
        false_pairs=[pair for pair in pairs if not hidden.keys() & set(pair)],
        covered={name: low <= true <= high for name, (true, _, low, high) in estimates.items()},
        estimates={name: list(values) for name, values in estimates.items()},
        located=_located(unknown[0], report["unexplained"], tones_hz) if unknown else None,
        flagged=bool(report["unexplained"]),
        formed=_formed(unknown[0], report["characterised"]) if unknown else None,
        heldout_loglik=None if gain is None else gain["heldout_loglik"],
        explained_share=report["explained_share"],
    )


def known(case: Case) -> tuple[Hidden, ...]:
    """Return what a catalogue can name of what is hidden."""
    there = tuple(each for each in case.hidden if each.form != "unknown")
    return (*there, OF_PAPER) if case.kind == "paper" else there


def _found(name: str, named: Mapping[str, Any], pairs: list[list[str]]) -> str:
    if name in named:
        return str(named[name]["verdict"])
    return "cannot_tell" if any(name in pair for pair in pairs) else ""


def _estimates(
    hidden: Mapping[str, Hidden], named: Mapping[str, Any]
) -> dict[str, tuple[float, float, float, float]]:
    """Return truth, estimate and interval of what is named and has the catalogue's form."""
    found = {}
    for name in hidden.keys() & named.keys():
        if hidden[name].form != "catalogue":
            continue
        for place, (parameter, true) in enumerate(hidden[name].parameters.items()):
            # Of what only another shape of it explains, no size is claimed.
            estimate = named[name]["parameters"].get(parameter)
            if estimate is not None and estimate["ci95"] is not None:
                low, high = estimate["ci95"]
                of = f"{name}.{parameter}" if place else name
                found[of] = (true, float(estimate["value"]), float(low), float(high))
    return found


def _formed(name: str, forms: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether the form that explains most is that of an unknown effect."""
    return bool(forms) and forms[0]["id"] == FORM_OF.get(name)


def _located(name: str, left: Iterable[Mapping[str, Any]], tones_hz: Iterable[float]) -> bool:
    """Return whether one entry has the covariate, and half of the tones of either in both."""
    tones = frozenset(tones_hz)
    band, covariates = WHERE[name]
    true = tones if band is None else _within(tones, band)
    for entry in left:
        if (entry["covariate"] or "none") not in covariates:
            continue
        said = _within(tones, entry["band_hz"])
        if 2 * len(true & said) >= max(len(true), len(said)) > 0:
            return True
    return False


def _within(tones_hz: frozenset[float], band_hz: Iterable[float]) -> frozenset[float]:
    low, high = band_hz
    return frozenset(tone for tone in tones_hz if 0.999 * low <= tone <= 1.001 * high)
