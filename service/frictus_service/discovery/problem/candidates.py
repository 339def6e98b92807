"""Which parameters of which effects are tried, and patterns that have no cause."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final, Literal

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effect import EffectDefinition
from frictus_hardware.physics.effects import EFFECTS, KNOWN
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Probe, Simulator, predict
from frictus_service.discovery.evidence.background import MAINS_HZ
from frictus_service.discovery.evidence.evidence_rows import Subject, as_asked
from frictus_service.discovery.evidence.residuals import Compared
from frictus_service.discovery.problem.base_models import ResponseName

Channel = Literal["size", "phase", "second", "third", "line50", "line60", "low"]
Covariate = Literal[
    "none", "speed", "force", "speed x force", "minutes", "direction", "position"
]

MOST_BANDS: Final = 8
"""More tones than this are taken together with their neighbours."""


@dataclass(frozen=True, slots=True)
class Pattern:
    """A misfit that is the same at some tones and follows one covariate.

    Attributes
    ----------
    channel : str
        What it is a misfit of.
    tones : tuple of int
        Numbers of the tones; empty where the channel has none.
    covariate : str
        What it follows.
    form : int
        Which function of the covariate.
    imaginary : bool
        Of a harmonic.
    """

    channel: Channel
    tones: tuple[int, ...]
    covariate: Covariate
    form: int = 0
    imaginary: bool = False

    def of(self, subject: Subject) -> Compared:
        """Return the pattern, of size one at the ends of the covariate's range.

        Parameters
        ----------
        subject : Subject
            The evidence of one unit.
        """
        if self.form >= FORMS[self.covariate] - AS_ASKED.get(self.covariate, 0):
            subject = as_asked(subject)
        probe = subject.trials if self.channel in ("line50", "line60", "low") else subject.rows
        shape = _shape(self, probe.circumstances)
        nothing = Compared.zeros(subject.tone.size, subject.measured.line50.size)
        if self.channel in ("line50", "line60", "low"):
            return replace(nothing, **{self.channel: shape})
        shape = shape * np.isin(subject.tone, self.tones)
        if self.channel in ("size", "phase"):
            return replace(nothing, **{self.channel: shape})
        zero = np.zeros_like(shape)
        pair = np.column_stack([zero, shape] if self.imaginary else [shape, zero])
        return replace(nothing, **{self.channel: pair})


FORMS: Final[dict[Covariate, int]] = {
    "none": 1,
    "speed": 4,
    "force": 4,
    "speed x force": 1,
    "minutes": 3,
    "direction": 1,
    "position": 2,
}
AS_ASKED: Final[dict[Covariate, int]] = {"speed": 2, "force": 2}
"""The last forms: of what was asked for. Within a trial a finger's speed wanders by a few per
cent, without the scatter of contacts, and so tells more than conditions do: what differs from
condition to condition, but not so within them (a threshold between two speeds, skin that
follows slowly), would be denied by it."""


def scaled(covariate: Covariate, at: SlidingConditions) -> FloatArray:
    """Return a covariate on a scale from about -1 to 1.

    Parameters
    ----------
    covariate : str
        One with values of its own: speed, force, minutes, direction, position.
    at : SlidingConditions
        Of each row.
    """
    if covariate == "speed":
        return (at.speed_mm_s - 60.0) / 40.0
    if covariate == "force":
        force: FloatArray = np.log(np.maximum(at.normal_force_n, 1e-3) / 0.4) / np.log(1.5)
        return force
    if covariate == "minutes":
        last = max(float(np.max(at.minutes, initial=0.0)), 1e-9)
        return 2.0 * at.minutes / last - 1.0
    if covariate == "position":
        return (at.position_mm - 35.0) / 25.0
    return at.direction


def _shape(pattern: Pattern, at: SlidingConditions) -> FloatArray:
    speed, force, time = (scaled(name, at) for name in ("speed", "force", "minutes"))
    position = scaled("position", at)
    shapes: dict[Covariate, tuple[FloatArray, ...]] = {
        "none": (np.ones_like(speed),),
        "speed": (speed, speed**2, speed, speed**2),
        "force": (force, force**2, force, force**2),
        "speed x force": (speed * force,),
        "minutes": (time, time**2, np.sign(time) - 1.5 * time),
        "direction": (scaled("direction", at),),
        "position": (position, position**2),
    }
    return shapes[pattern.covariate][pattern.form]


def patterns_of(n_tones: int, *, skin: bool) -> list[Pattern]:
    """Return the patterns in which a misfit is looked for.

    Parameters
    ----------
    n_tones : int
        Of the study.
    skin : bool
        Of the mobility: no harmonics, lines or low frequencies.
    """
    found = [
        Pattern(channel, tones, covariate, form)
        for channel in ("size", "phase")
        for covariate, forms in FORMS.items()
        for form in range(forms)
        for tones in _bands(n_tones)
    ]
    return found if skin else [*found, *_elsewhere(n_tones)]


def _elsewhere(n_tones: int) -> Iterator[Pattern]:
    every = tuple(range(n_tones))
    harmonics: tuple[Channel, ...] = ("second", "third")
    covariates: tuple[Covariate, ...] = ("none", "speed", "force", "minutes")
    for channel, covariate, imaginary in product(harmonics, covariates, (False, True)):
        yield Pattern(channel, every, covariate, 0, imaginary)
    yield Pattern("line50", (), "none")
    yield Pattern("line60", (), "none")
    yield Pattern("low", (), "speed", 1)
    yield Pattern("low", (), "minutes", 0)


def _bands(n_tones: int) -> list[tuple[int, ...]]:
    """Return single tones or neighbours, both halves, and all."""
    every = np.arange(n_tones)
    groups = np.array_split(every, min(n_tones, MOST_BANDS))
    halves = np.array_split(every, 2) if n_tones > 3 else []
    bands = [tuple(group.tolist()) for group in [*groups, *halves, every]]
    return list(dict.fromkeys(bands))


Place = tuple[str, Covariate]
"""Kind of channel, and covariate."""


def places_of(patterns: Sequence[Pattern]) -> list[Place]:
    """Return what each pattern has in common with others."""
    kinds = {"size": "response", "phase": "response", "second": "harmonics"}
    kinds |= {"third": "harmonics", "line50": "lines", "line60": "lines", "low": "low"}
    return [(kinds[pattern.channel], pattern.covariate) for pattern in patterns]


MODE_HZ: Final = tuple(float(round(f)) for f in np.geomspace(80.0, 800.0, 13))
"""Where a further mode of the skin is looked for."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One parameter of an effect, the others held.

    Attributes
    ----------
    effect : str
        Id in `frictus_hardware.physics.effects`.
    parameter : str
        The one that is tried.
    step : float
        At which the derivative is taken.
    held : tuple of (str, float)
        The effect's other parameters.
    squared : bool
        Data follow the square of the parameter (a power), and so the signature is per square.
    positive : bool
        It cannot be negative.
    """

    effect: str
    parameter: str
    step: float
    held: tuple[tuple[str, float], ...] = ()
    squared: bool = False
    positive: bool = False

    @property
    def limits(self) -> tuple[float, float]:
        """Between which coefficients a step more changes something."""
        bounds = next(p for p in KNOWN[self.effect].parameters if p.name == self.parameter)
        if self.squared:
            return 0.0, bounds.high**2 - self.step**2
        return bounds.low, bounds.high - self.step

    def extend(self, simulator: Simulator, coefficient: float) -> Simulator:
        """Return the simulator with the effect in it.

        Parameters
        ----------
        simulator : Simulator
            A rig and one finger.
        coefficient : float
            The parameter, or its square where data follow that. Limited to its bounds.
        """
        if coefficient == 0.0:
            return simulator
        value = np.sqrt(max(coefficient, 0.0)) if self.squared else coefficient
        effect = KNOWN[self.effect]
        bounds = next(p for p in effect.parameters if p.name == self.parameter)
        limited = float(np.clip(value, bounds.low, bounds.high))
        return effect.extend(simulator, {**dict(self.held), self.parameter: limited})


def candidates_of(response: ResponseName, present: Collection[str] = ()) -> list[Candidate]:
    """Return the candidates, by id.

    Parameters
    ----------
    response : {'friction', 'mobility'}
    present : collection of str
        Effects that the base model has already.
    """
    found = []
    for name in sorted(EFFECTS):
        effect = EFFECTS[name]
        if effect.response in (response, "both") and name not in present:
            found.extend(_of(effect))
    return found


def _of(effect: EffectDefinition) -> list[Candidate]:
    dose = effect.parameters[0]
    one = Candidate(
        effect.id,
        dose.name,
        dose.step,
        squared=_goes_with_square(effect),
        positive=dose.low >= 0.0,
    )
    if effect.id == "mains_interference":
        return [replace(one, held=(("frequency_hz", line),)) for line in MAINS_HZ]
    if any(parameter.name == "frequency_hz" for parameter in effect.parameters):
        return [replace(one, held=(("frequency_hz", f),)) for f in MODE_HZ]
    return [one]


def _goes_with_square(effect: EffectDefinition) -> bool:
    """Return whether data follow the square of the dose: twice the dose, four times as much."""
    once, twice = (_shown(effect, times) for times in (1.0, 2.0))
    return bool(once > 0.0 and twice > 3.0 * once)


def _shown(effect: EffectDefinition, times: float) -> float:
    """Return the power that a dose puts into a slow stroke without drive."""
    dose = effect.parameters[0]
    one = np.ones(1)
    at = SlidingConditions(10.0 * one, 0.4 * one, 35.0 * one, one, 0.0 * one)
    probe = Probe(100.0 * one, np.zeros(1, dtype=np.complex128), 0.0 * one, 0.0 * one, at)
    simulator = effect.extend(Simulator(), {dose.name: times * dose.step})
    seen = predict(simulator, probe, Simulator().mount)
    return float(np.square(seen.line_n[0]) + seen.low_n2[0])
