"""What is said of a document that is not valid."""

from typing import Annotated

import pytest
from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from frictus import Texture
from frictus.errors import explain
from frictus.names import Name


class Asked(BaseModel):
    participant: Name
    site: str


def test_letters_that_are_accepted_are_named_and_what_is_missing_is_not_shown() -> None:
    with pytest.raises(ValidationError) as caught:
        Asked.model_validate({"participant": "P 01"})
    assert explain(caught.value) == (
        "participant: ASCII letters, digits, '.', '_' and '-' are accepted (got 'P 01'); "
        "site: Field required"
    )


def test_what_is_taken_for_a_name_s_pattern_is_not_another_that_begins_like_it() -> None:
    class Longer(BaseModel):
        text: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+/[0-9]$")]

    with pytest.raises(ValidationError) as caught:
        Longer.model_validate({"text": "P01"})
    assert "+/[0-9]$" in explain(caught.value)


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({"kind": "slime"}, "document: 'kind' is 'slime'; accepted: 'spectrum', 'profile'"),
        ({"kind": "x" * 999}, "'kind' is 'xxxxxxxxxxxx...xxxxxxxxxxxxx'; accepted"),
        ({"schema": "design/1"}, "document: the key 'kind' is missing"),
    ],
)
def test_of_a_union_the_kinds_are_named_in_plain_words(document: object, said: str) -> None:
    with pytest.raises(ValidationError) as caught:
        TypeAdapter[Texture](Texture).validate_python(document)
    assert said in explain(caught.value)
    assert len(explain(caught.value)) < 200
