"""What the name of a recording says: who was measured, and what was asked.

Laboratories write it into names of folders, files and groups: `P03/slow_1N_2.csv`. A template
as `{participant}/{}_{force_n}N_{}` reads it.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from frictus_service.data_import.formats.columns import Columns
from frictus_service.errors import FieldError, listed

NUMBER: Final = r"\d{1,9}(?:[.,p]\d{1,9})?"
ENTRIES: Final = {
    "participant": r"[^/]+?",
    "session": r"\d{1,4}",
    **dict.fromkeys(("speed_mm_s", "stage_speed_mm_s", "force_n", "normal_load_n"), NUMBER),
}
"""Entries of the column map that a name may say; file systems have 0p5 for 0.5."""
ANYTHING: Final = r"[^/]*?"
MOST_ANYTHING: Final = 3
"""Within levels: each multiplies the ways in which a name may be read."""
MAX_LETTERS: Final = 200
MOST_TOLD: Final = 5
PERSON: Final = re.compile(
    r"(?<![^\W_])(?:p|vp|pers|person|proband|sub|subj|subject|participant)[-_ ]?\d{1,4}"
    r"(?![^\W_])",
    re.IGNORECASE,
)
"""What people are called in names; `s3` may as well be a session or a surface."""
PERSON_FIELDS: Final = frozenset(
    "participant participantid subject subjectid subjectname subj vp proband".split()
)


def is_person_field(name: str) -> bool:
    """Return whether a field of a recording, or an attribute, is called as one of a person."""
    return "".join(filter(str.isalnum, name.lower())) in PERSON_FIELDS


def check_template(template: str) -> None:
    """Refuse what is no template.

    Parameters
    ----------
    template : str
        Names of entries in braces, ``{}`` for anything; one level for each ``/``.

    Raises
    ------
    ValueError
        The text says what is accepted.
    """
    asked = re.findall(r"\{([^{}]*)\}", template)
    rest = re.sub(r"\{[^{}]*\}", "", template)
    unknown = [name for name in asked if name and name not in ENTRIES]
    if unknown:
        raise ValueError(
            f"names has {{{unknown[0]}}}; accepted: {', '.join(ENTRIES)}, and {{}} for anything"
        )
    if "{" in rest or "}" in rest or not any(asked):
        raise ValueError(
            "names is a template such as {participant}_{speed_mm_s}mms_{}, of "
            f"{', '.join(ENTRIES)}, and {{}} for anything"
        )
    if len(asked) - asked.count("") > len(set(asked) - {""}) or "}{" in template:
        raise ValueError("names has an entry twice, or nothing between two of them")
    if (
        sum(level != "{}" and level.count("{}") for level in template.split("/"))
        > MOST_ANYTHING
    ):
        raise ValueError(f"names has {{}} within levels more than {MOST_ANYTHING} times")


def levels_of(file: Path) -> str:
    """Return all folders of a file and its name without the ending, apart by ``/``."""
    return "/".join((*file.resolve().parent.parts, file.stem))


def place_of(file: str, group: str) -> str:
    """Return the name of a recording, its levels apart by ``/``.

    Parameters
    ----------
    file : str
        Levels to the file, without its ending.
    group : str
        As `groups_of` calls it; empty of a file that is one recording.
    """
    return "/".join((file, *group.split("."))) if group else file


def said_by(template: str, place: str) -> dict[str, str | int | float]:
    """Return what a name says, by entry of the column map.

    Parameters
    ----------
    template : str
        From `check_template`.
    place : str
        Levels from folder to group, the last ones of which are read.

    Raises
    ------
    FieldError
        If the name does not have the form.
    """
    levels = place.split("/")[-(template.count("/") + 1) :]
    name = "/".join(levels)
    found = None if len(name) > MAX_LETTERS else _pattern(template).fullmatch(name)
    if found is None:
        raise FieldError(
            "names",
            f"is {template!r}, and the recording is called {name[:MAX_LETTERS]!r}; accepted: a "
            "template that every name fits, with {} for what differs and says nothing, or none",
        )
    return {entry: _value(entry, said) for entry, said in found.groupdict().items()}


def _value(entry: str, said: str) -> str | int | float:
    if entry == "participant":
        return said
    return int(said) if entry == "session" else float(re.sub("[,pP]", ".", said))


def _pattern(template: str) -> re.Pattern[str]:
    parts = re.split(r"\{([^{}]*)\}", template)
    pattern = "".join(
        re.escape(part)
        if number % 2 == 0
        else f"(?P<{part}>{ENTRIES[part]})"
        if part
        else ANYTHING
        for number, part in enumerate(parts)
    )
    return re.compile(pattern, re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class ProposedPeople:
    """How a file says who was measured.

    Attributes
    ----------
    entry, value : str
        Of the column map.
    reason : str
        In words, with whom it calls.
    """

    entry: str
    value: str
    reason: str


def propose_people(recordings: Mapping[str, Columns], file: str) -> ProposedPeople | None:
    """Return how recordings say who was measured; None where they do not.

    Parameters
    ----------
    recordings : mapping of str to Columns
        Of a file, by group.
    file : str
        Levels to the file, without its ending.
    """
    fields = [
        [(name, said) for name, said in each.fields.items() if is_person_field(name)]
        for each in recordings.values()
    ]
    if all(fields):
        entry, (value, _) = "participant_field", fields[0][0]
        said = [str(dict(each).get(value, "")) for each in fields]
    else:
        places = [place_of(file, group) for group in recordings]
        template = people_in(places)
        if template is None:
            return None
        entry, value = "names", template
        said = [str(said_by(template, place)["participant"]) for place in places]
    people = list(dict.fromkeys(said))
    return ProposedPeople(
        entry,
        value,
        f"participants are read by {entry} {value}: {listed(people, MOST_TOLD)} (set "
        "participant where these are no people)",
    )


def people_in(places: Sequence[str]) -> str | None:
    """Return the template that says who was measured; None where names call nobody.

    Parameters
    ----------
    places : sequence of str
        Of the recordings of a file, levels from folder to group; as many of all.
    """
    levels = list(zip(*(place.split("/") for place in places), strict=True))
    for names in sorted(levels, key=lambda names: len(set(names)) == 1):  # those that differ
        forms = {_form(PERSON.search(name)) for name in names}
        if len(forms) == 1 and (form := forms.pop()) is not None:
            return "/".join((form, *["{}"] * (len(levels) - 1 - levels.index(names))))
    return None


def _form(found: re.Match[str] | None) -> str | None:
    """Return a name with its person as an entry, and what stands around as anything."""
    if found is None:
        return None
    name, (begin, end) = found.string, found.span()
    before = f"{{}}{name[begin - 1]}" if begin else ""
    after = f"{name[end]}{{}}" if end < len(name) else ""
    return f"{before}{{participant}}{after}"


def speed_in(file_stem: str) -> float | None:
    """Return the speed that a file's name tells, mm/s, as `linen_50mmps`; None where none.

    Parameters
    ----------
    file_stem : str
        Its name without the ending.
    """
    found = re.search(r"(\d+(?:\.\d+)?)\s*(?:mmps|mm_s|mm\.s|mms)(?![a-z])", file_stem)
    return float(found[1]) if found and float(found[1]) > 0.0 else None
