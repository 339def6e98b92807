"""What is implausible about measurements: one sentence, and the remedy."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from frictus_service.errors import ImplausibleStudyError
from frictus_service.identification.observation.response import TrialObservations

Severity = Literal["stop", "warning"]


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that a healthy measurement does not show.

    Attributes
    ----------
    code : str
        Of the check, such as ``mobility_sign``.
    severity : {'stop', 'warning'}
        `stop`: every fit would be nonsense.
    sentence : str
        What is wrong, with the value and what is accepted; no full stop at the end.
    remedy : str
        What to do, as an imperative; no full stop at the end.
    trials : tuple of str
        Ids of the trials concerned.
    value : float
        Of the statistic.
    accepted : tuple of float
        Lowest and highest accepted value.
    leaves_out : bool
        Whether these trials are not to be used, though the rest of the study can be: a
        minority of the participants shows what would stop otherwise.
    """

    code: str
    severity: Severity
    sentence: str
    remedy: str
    trials: tuple[str, ...]
    value: float
    accepted: tuple[float, float]
    leaves_out: bool = False

    @property
    def text(self) -> str:
        """Sentence and remedy in one line."""
        return f"{self.sentence}; {self.remedy}"


def leave_out(
    observed: Iterable[TrialObservations], findings: Iterable[Finding]
) -> list[TrialObservations]:
    """Return the same trials, those that findings leave out not valid, with the reason.

    Parameters
    ----------
    observed : iterable of TrialObservations
        Of a study.
    findings : iterable of Finding
        Of the same study.
    """
    reasons: dict[str, list[str]] = {}
    for finding in findings:
        for trial in finding.trials if finding.leaves_out else ():
            reasons.setdefault(trial, []).append(finding.sentence)
    return [
        replace(each, valid=False, reasons=(*each.reasons, *reasons[each.info.id]))
        if each.info.id in reasons
        else each
        for each in observed
    ]


def stop_if_implausible(findings: Iterable[Finding], where: str) -> None:
    """Raise where a finding makes every fit nonsense.

    Parameters
    ----------
    findings : iterable of Finding
        Of a study or a trial.
    where : str
        The file, for the message.

    Raises
    ------
    ImplausibleStudyError
        It names all findings that stop.
    """
    remedies: dict[str, list[str]] = {}
    for each in findings:
        if each.severity == "stop":
            remedies.setdefault(each.remedy, []).append(each.sentence)
    if remedies:
        told = [f"{'; '.join(said)}. To do: {remedy}" for remedy, said in remedies.items()]
        raise ImplausibleStudyError(f"{where}: nothing was fitted: {'. '.join(told)}")
