"""What is said of a document that is not valid."""

import pytest
from pydantic import BaseModel, ValidationError

from frictus.errors import explain
from frictus.messages.base import ClientName


class Asked(BaseModel):
    participant: ClientName
    site: str


def test_letters_that_are_accepted_are_named_and_what_is_missing_is_not_shown() -> None:
    with pytest.raises(ValidationError) as caught:
        Asked.model_validate({"participant": "P 01"})
    assert explain(caught.value) == (
        "participant: ASCII letters, digits, '.', '_' and '-' are accepted (got 'P 01'); "
        "site: Field required"
    )
