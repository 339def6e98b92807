"""Base models by name, and what every finger has of its own that is no error of a model."""

from dataclasses import replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
from pydantic import ValidationError

from frictus.errors import explain
from frictus.model import FirstOrderSpeedLaw, MassSpringDamper, Model
from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import EffectParameterError, UnknownEffectError
from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mobility, TransferFunction
from frictus_hardware.physics.simulator import Simulator
from frictus_service import json_text
from frictus_service.errors import BaseModelError

ResponseName = Literal["friction", "mobility"]

NUISANCE: Final[dict[ResponseName, tuple[str, ...]]] = {
    "friction": ("gain_n", "cutoff_hz", "quiet_n2"),
    "mobility": ("mass_kg", "damping_n_s_m", "stiffness_n_m"),
}
"""What everybody has of their own, as a multiple of the base model's."""

QUIET: Final = 2
"""Which of a friction response's is the power from 4 to 30 Hz that is there anyway."""

RANDOM_EFFECTS: Final = frozenset(
    {
        "speed_dependent_gain",
        "speed_dependent_cutoff",
        "force_dependent_gain",
        "force_dependent_cutoff",
        "speed_dependent_mass",
        "speed_dependent_stiffness",
    }
)
"""Effects in which people differ by chance, whether or not they have some of them in common:
nobody's gain and cutoff follow speed and force quite as others' do."""

DEVIATING: Final[dict[ResponseName, int]] = {"friction": 2, "mobility": 3}
"""How many of these, from the first, deviate from condition to condition."""


def _own_friction(base: Simulator, own: FloatArray) -> Simulator:
    gain, cutoff = np.exp(own[:QUIET])
    law = replace(
        base.law,
        gain_n=base.law.gain_n * gain,
        cutoff_0_hz=base.law.cutoff_0_hz * cutoff,
        slope_hz_per_mm_s=base.law.slope_hz_per_mm_s * cutoff,
    )
    return replace(base, law=law)


def _own_skin(base: Simulator, own: FloatArray) -> Simulator:
    mass, damping, stiffness = np.exp(own)
    skin = base.mobility
    return replace(
        base,
        mobility=Mobility(
            skin.mass_kg * mass, skin.damping_n_s_m * damping, skin.stiffness_n_m * stiffness
        ),
    )


def law_with_own(
    law: FirstOrderSpeedLaw | MassSpringDamper, response: ResponseName, own: FloatArray
) -> FirstOrderSpeedLaw | MassSpringDamper:
    """Return a base law with somebody's own values.

    Parameters
    ----------
    law : FirstOrderSpeedLaw or MassSpringDamper
        Of the response.
    response : {'friction', 'mobility'}
    own : ndarray, shape (n_nuisance,)
        Logarithms of the multiples of the law's values, in the order of `NUISANCE`.
    """
    scale = dict(zip(NUISANCE[response], np.exp(own).tolist(), strict=True))
    if isinstance(law, MassSpringDamper):
        own_values = {name: getattr(law, name) * value for name, value in scale.items()}
        return law.model_copy(update=own_values)
    return law.model_copy(
        update={
            "gain_n": law.gain_n * scale["gain_n"],
            "cutoff_0_hz": law.cutoff_0_hz * scale["cutoff_hz"],
            "slope_hz_per_mm_s": law.slope_hz_per_mm_s * scale["cutoff_hz"],
        }
    )


NUISANCE_SCALED: Final = {"friction": _own_friction, "mobility": _own_skin}


SPEEDS_MM_S: Final = (1.0, 200.0)
"""Where laws are taken at their word. Half of the strokes at a target of 20 or 100 mm/s are
slower or faster; a law that held still there would be bent for them."""
MIDDLE_SPEED_MM_S: Final = 60.0


def base_model(base: str, response: ResponseName) -> Model:
    """Return the model that is criticised.

    Parameters
    ----------
    base : str
        ``paper``, ``constant-cutoff`` or the path of a `model/1` document.
    response : {'friction', 'mobility'}

    Raises
    ------
    BaseModelError
        If there is no such file, it is no model, one of the other response, or has an effect
        that is not known or out of its bounds.
    """
    law, skin = FrictionLaw(), Mobility()
    if base == "paper" and response == "mobility":
        return Model(
            response="mobility",
            base=MassSpringDamper(
                mass_kg=skin.mass_kg,
                damping_n_s_m=skin.damping_n_s_m,
                stiffness_n_m=skin.stiffness_n_m,
            ),
        )
    if base == "paper":
        return _friction(law.cutoff_0_hz, law.slope_hz_per_mm_s)
    if base == "constant-cutoff" and response == "friction":
        return _friction(law.cutoff_0_hz + MIDDLE_SPEED_MM_S * law.slope_hz_per_mm_s, 0.0)
    if base == "constant-cutoff":
        raise BaseModelError(
            "constant-cutoff is a model of friction; for the mobility give paper or a file"
        )
    model = _read(Path(base))
    if model.response != response:
        raise BaseModelError(
            f"{base} is a model of the {model.response}, and the {response} is asked for; give "
            f"a {response} model, or --response {model.response}"
        )
    try:
        simulator_of(model, None)  # before an analysis of minutes
    except (UnknownEffectError, EffectParameterError) as error:
        raise BaseModelError(f"{base}: {error}") from error
    return model


def _friction(cutoff_0_hz: float, slope: float) -> Model:
    return Model(
        base=FirstOrderSpeedLaw(
            gain_n=FrictionLaw().gain_n, cutoff_0_hz=cutoff_0_hz, slope_hz_per_mm_s=slope
        )
    )


def _read(path: Path) -> Model:
    try:
        return Model.model_validate_json(json_text.read_file(path), strict=True)
    except FileNotFoundError as error:
        raise BaseModelError(
            f"no base model {str(path)!r}; accepted: paper, constant-cutoff, or a model/1 file"
        ) from error
    except ValidationError as error:
        raise BaseModelError(f"{path} is no model/1 document: {explain(error)}") from error
    except OSError as error:
        raise BaseModelError(f"{path} is no model/1 document: {error}") from error


def simulator_of(model: Model, mount: TransferFunction | None) -> Simulator:
    """Return what a model says of finger and rig.

    Parameters
    ----------
    model : Model
        A `model/1` document.
    mount : TransferFunction or None
        The study's.

    Raises
    ------
    UnknownEffectError, EffectParameterError
        If the model has an effect that is not known, or out of its bounds.
    """
    base = model.base
    effects = [(effect.id, effect.parameters) for effect in model.effects]
    if isinstance(base, FirstOrderSpeedLaw):
        law = FrictionLaw(base.gain_n, base.cutoff_0_hz, base.slope_hz_per_mm_s, SPEEDS_MM_S)
        simulator = Simulator(law=law, mount=mount, delay_s=model.skew_s)
    else:
        skin = Mobility(base.mass_kg, base.damping_n_s_m, base.stiffness_n_m)
        law = FrictionLaw(speed_range_mm_s=SPEEDS_MM_S)
        simulator = Simulator(
            law=law,
            mobility=skin,
            mount=mount,
            response="mobility",
            skin_delay_s=model.skew_s,
        )
    return extended(simulator, effects)
