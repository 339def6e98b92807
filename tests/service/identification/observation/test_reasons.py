"""All reasons are counted, those of one kind together."""

from frictus_service.identification.observation.observe import count_reasons, list_reasons


def test_figures_do_not_make_another_kind() -> None:
    found = count_reasons(
        [
            ("the mean is 1.5 N, +10% from 2 N", "clipped"),
            ("the mean is -3e-2 N, -20% from 4 N",),
            ("clipped", "clipped"),
            ("holds the same data as trial abc-7",),
            ("holds the same data as trial P01-0003",),
            ("holds the same data as trial xyz",),
            (),
        ]
    )
    assert [(each.trials, each.example) for each in found] == [
        (3, "holds the same data as trial abc-7"),
        (2, "the mean is 1.5 N, +10% from 2 N"),
        (2, "clipped"),
    ]


def test_many_kinds_are_cut_short() -> None:
    told = list_reasons([(letter * 3,) for letter in "abcdefghijk"])
    assert told.startswith("1 x aaa; 1 x bbb")
    assert told.endswith("; and 3 rarer kinds")
    assert list_reasons([]) == ""
