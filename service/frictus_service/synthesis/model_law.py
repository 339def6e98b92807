"""From a `model/1` document to the law that is rendered with."""

from frictus.errors import TextureError
from frictus.model import FirstOrderSpeedLaw, Model
from frictus_hardware.base import RigInfo
from frictus_hardware.errors import EffectParameterError
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis.compensability import inverse_of
from frictus_service.synthesis.compensation import Inverse, Ranges


def law_of(model: Model) -> FrictionLaw:
    """Return the friction law that a model states.

    Raises
    ------
    TextureError
        If the model is not one of friction: nothing can be rendered with it.
    """
    if not isinstance(model.base, FirstOrderSpeedLaw):
        raise TextureError(
            f"a {model.base.law!r} model says how the skin moves, not what friction it feels; "
            "give one with response 'friction'"
        )
    low, high = model.validity.speed_mm_s
    return FrictionLaw(
        model.base.gain_n, model.base.cutoff_0_hz, model.base.slope_hz_per_mm_s, (low, high)
    )


def inverse_of_model(model: Model, screen: Screen) -> Inverse:
    """Return what has to be undone so that a finger on a screen feels what is asked for.

    Raises
    ------
    TextureError
        If the model is not one of friction, or an effect has a parameter out of its range.
    """
    low, high = model.validity.normal_force_n
    effects = [(effect.id, effect.parameters) for effect in model.effects]
    try:
        return inverse_of(law_of(model), effects, Ranges((low, high), (0.0, screen.size_mm[0])))
    except EffectParameterError as error:
        raise TextureError(str(error)) from error


def placeholder_model() -> Model:
    """Return the model that stands in until somebody has measured one; it says so."""
    law = FrictionLaw()
    return Model(
        base=FirstOrderSpeedLaw(
            gain_n=law.gain_n,
            cutoff_0_hz=law.cutoff_0_hz,
            slope_hz_per_mm_s=law.slope_hz_per_mm_s,
        ),
        placeholder=True,
        provenance={"source": "published population values; nobody measured this rig"},
    )


def screen_of(info: RigInfo) -> Screen:
    """Return the screen that a backend drives."""
    return Screen(peak_v=info.screen_peak_v, size_mm=info.screen_mm)
