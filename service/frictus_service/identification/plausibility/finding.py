"""What is implausible about measurements: one sentence, and the remedy."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from frictus_service.errors import ImplausibleStudyError

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
    """

    code: str
    severity: Severity
    sentence: str
    remedy: str
    trials: tuple[str, ...]
    value: float
    accepted: tuple[float, float]

    @property
    def text(self) -> str:
        """Sentence and remedy in one line."""
        return f"{self.sentence}; {self.remedy}"


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
