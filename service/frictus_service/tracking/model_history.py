"""The models that a rig says it renders by: which was set, and which followed the finger."""

from enum import Enum, auto

from frictus.messages import ModelState


class ModelStep(Enum):
    """How a model came to be the one in force."""

    SAME = auto()
    """It was in force already."""
    SET = auto()
    """Somebody set it: for another person, perhaps."""
    FOLLOWED = auto()
    """It was adapted to the finger while it played, or put back as it was set."""


class ModelHistory:
    """What is heard of the model in force.

    Attributes
    ----------
    newest : ModelState or None
        In force.
    as_set : ModelState or None
        Before it was adapted, where that was heard.
    """

    def __init__(self) -> None:
        self.newest: ModelState | None = None
        self.as_set: ModelState | None = None

    def add(self, new: ModelState) -> ModelStep:
        """Take note of a model and return how it came.

        Parameters
        ----------
        new : ModelState
            As the rig published it.
        """
        old, self.newest = self.newest, new
        if old is not None and new.etag == old.etag:
            return ModelStep.SAME
        put_back = self.as_set is not None and new.etag == self.as_set.etag
        if old is None or not (put_back or new.adapted_from == old.etag):
            self.as_set = new if new.adapted_from is None else None
            return ModelStep.SET
        return ModelStep.FOLLOWED
