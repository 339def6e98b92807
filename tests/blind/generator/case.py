"""What is hidden in a study, and how the study is run: plain data that JSON holds."""

from dataclasses import dataclass, field
from typing import Literal

Order = Literal["random", "speed_blocks"]


@dataclass(frozen=True, slots=True)
class Hidden:
    """One thing that the paper's law does not have.

    Attributes
    ----------
    name : str
        A cause of the catalogue, or one of the unknown ones.
    form : str
        "catalogue" where the equation is the catalogue's.
    parameters : dict
        In units as their names say.
    """

    name: str
    parameters: dict[str, float]
    form: str = "catalogue"


@dataclass(frozen=True, slots=True)
class Design:
    """Which trials are run; each person has all conditions once, whatever their number.

    Attributes
    ----------
    n_tones, n_speeds, n_forces : int
        No tones: noise drives, in a trial of each speed and force.
    tones_hz : tuple of float
        Lowest and highest tone.
    near_hz : float
        One of the tones lies within 5 % of this; 0: anywhere.
    tones_per_trial : int
        1 or 3; three at once make a condition of speed and force five times repeated.
    seconds : float
    order : {'random', 'speed_blocks'}
    base : {'paper', 'constant_cutoff'}
        Law that everybody's friction follows, besides what is hidden.
    lifelike : bool
        Turns of minimum jerk, with pauses; touch reports that are late; tones of each person's
        own; a fifth of the trials missing; a gain that wanders from trial to trial.
    fault : str
        Of the instruments, one of `faults.FAULTS`; empty: none.
    """

    participants: int = 12
    n_tones: int = 5
    n_speeds: int = 4
    n_forces: int = 3
    tones_hz: tuple[float, float] = (30.0, 2000.0)
    near_hz: float = 0.0
    tones_per_trial: int = 1
    seconds: float = 2.0
    order: Order = "random"
    base: Literal["paper", "constant_cutoff"] = "paper"
    lifelike: bool = False
    fault: str = ""


@dataclass(frozen=True, slots=True)
class Case:
    """A kind of test, what is hidden, and the design.

    Attributes
    ----------
    kind : str
        As `tests.blind.cases` names them.
    """

    kind: str
    hidden: tuple[Hidden, ...] = ()
    design: Design = field(default_factory=Design)
