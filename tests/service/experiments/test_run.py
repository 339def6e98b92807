"""A participant on a page: asked, waited for, and not for ever."""

import queue
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import pytest

from frictus.experiment import Experiment, Protocol, ScheduledTrial
from frictus.experiment.procedures.schedule import begun
from frictus.experiment.protocol import parse_protocol, ready_protocols
from frictus.experiment.trial_log import FORMAT
from frictus_service.errors import UnattendedError
from frictus_service.experiments import run
from frictus_service.experiments.job import Answer, Input, ParticipantScreen, Pause


class Clock:
    """Moves by the same step whenever it is read."""

    def __init__(self, step_s: float) -> None:
        self.now_s, self.step_s = 0.0, step_s

    def __call__(self) -> float:
        self.now_s += self.step_s
        return self.now_s


@pytest.fixture
def protocol() -> Protocol:
    path = ready_protocols()["detection"]
    return parse_protocol(path.read_bytes(), path.name)


def participant(
    protocol: Protocol,
    inputs: "queue.SimpleQueue[Input]",
    clock: Clock,
    rows: Sequence[dict[str, Any]] = (),
) -> tuple[run.PageParticipant, ScheduledTrial, list[ParticipantScreen]]:
    header = {"format": FORMAT, "participant": "P01", "seed": 1, "order_row": 0}
    trial = begun(protocol, header | {"protocol": protocol.model_dump(mode="json")}).next()
    assert trial is not None
    experiment = SimpleNamespace(protocol=protocol, rows=rows, require_ready=lambda: None)
    shown: list[ParticipantScreen] = []
    person = run.PageParticipant(
        cast(Experiment, experiment),
        inputs,
        shown.append,
        lambda: False,
        clock,
    )
    return person, trial, shown


def test_a_rig_is_given_back_where_nobody_answers(
    protocol: Protocol, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "LOOK_S", 1e-3)
    clock = Clock(60.0)
    person, trial, shown = participant(protocol, queue.SimpleQueue(), clock)
    with pytest.raises(UnattendedError, match=r"10 minutes: the rig is given back.*resume"):
        person.ask(trial, [])
    assert [screen.phase for screen in shown] == ["question"]
    assert clock.now_s == pytest.approx(run.UNATTENDED_S, abs=5 * 60.0)


@pytest.mark.parametrize("given", ["an answer to another question", "a pause"])
def test_who_does_something_is_there(
    given: str, protocol: Protocol, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "LOOK_S", 1e-3)
    inputs: queue.SimpleQueue[Input] = queue.SimpleQueue()
    person, trial, _ = participant(protocol, inputs, Clock(200.0))
    # Six of them, a minute and more apart, last longer than anybody may be away.
    for _ in range(6):
        inputs.put(
            Pause(pause=False)
            if given == "a pause"
            else Answer(trial=trial.number, step=99, answer="1")
        )
    inputs.put(Answer(trial=trial.number, step=1, answer="2"))
    assert cast(Any, person).ask(trial, []) == "2"


def test_what_the_rig_could_not_render_is_told_as_it_happens(protocol: Protocol) -> None:
    main = {"phase": "main", "catch": False}
    rows = [
        main | {"status": "answered"},
        main | {"status": "refused"},
        {"phase": "practice", "catch": False, "status": "refused"},
    ]
    person, trial, shown = participant(protocol, queue.SimpleQueue(), Clock(0.0), rows)
    person.begin(trial, 1)
    assert (shown[-1].answered, shown[-1].refused) == (1, 2)
