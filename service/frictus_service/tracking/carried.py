"""A model that was measured on another rig: its finger is the same, its delay is not."""

from frictus.model import Model


def carried(model: Model, place: str) -> Model:
    """Return what a model says on a rig: without the delay of another one.

    Parameters
    ----------
    model : Model
        With the name of the rig, with or without its site, in its provenance, if it is known.
    place : str
        Of the rig on which it is in force, ``site/rig``.
    """
    rig = place.rpartition("/")[2]
    if model.provenance.get("rig") in (None, rig, place):
        return model
    return model.model_copy(update={"skew_s": 0.0})
