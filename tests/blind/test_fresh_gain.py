"""The campaign on gains counts studies whose gain has no interval, and those without a gain."""

from typing import Any

from tests.blind.fresh_gain import predicted, table


def test_a_gain_without_an_interval_is_counted_and_not_judged() -> None:
    lines: list[dict[str, Any]] = [
        _line(1, {"heldout_loglik": 5.0, "ci95": [1.0, 9.0]}),
        _line(2, {"heldout_loglik": 4.0, "ci95": None}),
        {"number": 3, "seed": 30, "predicted": None},
    ]
    told = table(lines)
    assert "| studies; of them with a gain; with its interval | 3; 2; 1 |" in told
    assert "within the interval predicted | 1 of 1, 100.0 % [" in told
    assert "above zero | 2 of 2 |" in told


def test_without_any_interval_or_any_gain_there_is_no_share() -> None:
    assert "predicted | - |" in table([_line(1, {"heldout_loglik": 4.0, "ci95": None})])
    nothing = table([{"number": 1, "seed": 10, "predicted": None}])
    assert nothing == "1 studies, none of them with a gain."


def _line(number: int, gain: dict[str, Any]) -> dict[str, Any]:
    return {
        "number": number,
        "seed": 10 * number,
        "predicted": predicted(gain),
        "fresh": 3.0,
        "one_scatter": 50.0,
    }
