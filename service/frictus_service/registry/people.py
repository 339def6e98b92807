"""Earlier people's models, for whoever is calibrated next."""

from typing import Final

from frictus.model import Model
from frictus_service.registry.store import Registry

MOST: Final = 200
_LAW: Final = frozenset({"gain_n", "cutoff_0_hz", "slope_hz_per_mm_s"})


def earlier_people(registry: Registry, besides: str) -> tuple[Model, ...]:
    """Return the newest published friction model of each participant, newest first.

    Models without a covariance of their law are left out: nothing can be learned from them.

    Parameters
    ----------
    registry : Registry
        Of published models.
    besides : str
        Pseudonym of a participant whose own models are left out.
    """
    found: dict[str, Model] = {}
    after = 0
    while len(found) < MOST:
        page = registry.find(population=False, response="friction", newest=True, after=after)
        for summary in page.models:
            person = summary.participant
            if person is None or person == besides or person in found:
                continue
            model = registry.get(summary.reference).model
            if model.covariance is not None and _LAW <= set(model.covariance.parameters):
                found[person] = model
        if page.next is None:
            break
        after = page.next
    return tuple(found.values())
