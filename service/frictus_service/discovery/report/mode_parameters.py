"""The parameters of a further mode of the skin, as a document says them."""

from collections.abc import Mapping

import numpy as np

from frictus_service.discovery.document import ParameterEstimate
from frictus_service.discovery.inference.mode_fit import ShapeEstimate
from frictus_service.discovery.inference.mode_shape import SHAPE


def with_mode_intervals(
    found: Mapping[str, ParameterEstimate], dose: str, shape: ShapeEstimate
) -> dict[str, ParameterEstimate]:
    """Return the parameters of a mode with the intervals that its fit gives.

    Parameters
    ----------
    found : mapping of str to ParameterEstimate
        The interval of the share is that of a mode of known shape.
    dose : str
        Name of the share.
    shape : ShapeEstimate
        Of the same mode, fitted.
    """
    parameters = dict(found)
    for name, half in zip(SHAPE, shape.half_widths, strict=True):
        value = found[name].value
        ends = (value * float(np.exp(-half)), value * float(np.exp(half)))
        parameters[name] = found[name].model_copy(update={"ci95": ends})
    share = found[dose]
    if share.ci95 is not None:
        low, high = share.ci95
        half = float(np.hypot((high - low) / 2.0, shape.share_half_width))
        middle = (low + high) / 2.0
        wider = {"ci95": (middle - half, middle + half)}
        parameters[dose] = share.model_copy(update=wider)
    return parameters
