"""What a plan criticises, and what will be measured with."""

from dataclasses import dataclass

from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.simulator import Simulator
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.discovery.problem.nuisance import ResponseName


@dataclass(frozen=True, slots=True)
class Setup:
    """Base model, rig and catalogue.

    Attributes
    ----------
    base : Simulator
        The base model.
    nominal_mount : TransferFunction or None
        The study's; None: none.
    response : {'friction', 'mobility'}
    candidates : tuple of Candidate
        Parameters of effects that are tried.
    carrier_hz, sample_rate_hz : float
        Of the rig.
    """

    base: Simulator
    nominal_mount: TransferFunction | None
    response: ResponseName
    candidates: tuple[Candidate, ...]
    carrier_hz: float = 7000.0
    sample_rate_hz: float = 20_000.0
