"""The names of sites, rigs, clients, tokens, participants and recordings."""

from typing import Annotated, Final

from pydantic import Field

NAME: Final = r"^[A-Za-z0-9._-]+$"
"""What a name can be, as a pattern."""
NAME_ACCEPTED: Final = "ASCII letters, digits, '.', '_' and '-' are accepted"
"""The same for people."""
MAX_NAME: Final = 64
"""Characters of the name of a site, a rig or a client."""
Name = Annotated[str, Field(min_length=1, max_length=MAX_NAME, pattern=NAME)]
