"""The names of sites, rigs, clients, tokens, participants and recordings."""

import re
from dataclasses import dataclass
from typing import Annotated, Any, Final

from pydantic import AfterValidator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema


@dataclass(frozen=True, slots=True)
class Matching:
    """Holds a text to a pattern, as ``Annotated[str, Matching(...)]``; refuses it in words.

    Attributes
    ----------
    pattern : str
        From ``^`` to ``$``, as a JSON schema has it.
    accepted : str
        What it accepts, for people.
    """

    pattern: str
    accepted: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Check what the type itself accepts."""
        return core_schema.no_info_after_validator_function(self._checked, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Tell the pattern, as a field with a pattern does."""
        return {**handler(schema), "pattern": self.pattern}

    def _checked(self, text: str) -> str:
        if re.fullmatch(self.pattern, text) is None:
            raise ValueError(self.accepted)
        return text


NAME: Final = Matching(
    r"^[A-Za-z0-9._-]+$", "ASCII letters, digits, '.', '_' and '-' are accepted"
)
"""What a name can be."""
MAX_NAME: Final = 64
"""Characters of the name of a site, a rig or a client."""
Name = Annotated[str, Field(min_length=1, max_length=MAX_NAME), NAME]


def _shown(text: str) -> str:
    if not text.isprintable():
        raise ValueError("letters and signs that show are accepted, no control characters")
    return text


Pseudonym = Annotated[str, Field(max_length=64), AfterValidator(_shown)]
"""Of a participant, as studies take it."""


def name_in(content: bytes) -> str:
    """Return the name that some bytes hold; empty where they hold none.

    Parameters
    ----------
    content : bytes
        Of a sender: other characters could steer the terminal that shows who stopped a rig.
    """
    name = content.decode("ascii", "replace")
    return name if re.fullmatch(NAME.pattern, name) and len(name) <= MAX_NAME else ""
