"""Bases of what is read: messages and textures leniently, what a person writes exactly."""

from difflib import get_close_matches
from typing import Any, Final

from pydantic import BaseModel, BeforeValidator, ConfigDict
from pydantic._internal._model_construction import ModelMetaclass  # it has no public name
from pydantic_core import PydanticCustomError


def _no_truth(value: object) -> object:
    if isinstance(value, bool):
        raise PydanticCustomError("truth", "Input should be a valid number")
    return value


NO_TRUTH: Final = BeforeValidator(_no_truth)
"""Of a literal number: there true is taken for 1, however strict the model is."""


def _tuple_of(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


LISTED: Final = BeforeValidator(_tuple_of)
"""Of a tuple that stands in a document as a list, whoever parsed it: read strictly, it takes
a list only where pydantic parses the JSON itself."""


class _Spelled(ModelMetaclass):
    """Refuses a misspelt argument; what is read (`model_validate`) does not pass here."""

    def __call__(self, *args: Any, **given: Any) -> Any:
        fields = self.model_fields  # type: ignore[attr-defined]  # of each model
        if unknown := given.keys() - fields.keys():
            named = min(unknown)
            close = get_close_matches(named, fields, n=1)
            meant = f"did you mean {close[0]!r}? " if close else ""
            taken = ", ".join(fields)
            raise TypeError(f"{self.__name__} has no {named!r}: {meant}it takes {taken}")
        return super().__call__(*args, **given)


class Lenient(BaseModel, metaclass=_Spelled):
    """Passes over what newer writers add to it, but no argument of a program.

    A misspelt `phase` would be another texture without a word.
    """

    model_config = ConfigDict(extra="ignore", frozen=True)


class Exact(BaseModel):
    """Takes what its fields say and nothing else."""

    model_config = ConfigDict(extra="forbid", frozen=True)
