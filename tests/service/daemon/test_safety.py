"""The safety machine: no output unless armed with a fresh lease, whatever happens."""

from dataclasses import replace
from typing import Any, get_args

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from frictus.messages import FaultKind
from frictus_service.daemon.safety import (
    ACTIONS,
    LASTING,
    LATCHING,
    Announce,
    Arm,
    ClientVanished,
    Disarm,
    Event,
    FaultCleared,
    FaultRaised,
    OutputQuiet,
    Refuse,
    Renew,
    Reset,
    Safety,
    Stop,
    Tick,
    Tripped,
    step,
)

KINDS: tuple[FaultKind, ...] = get_args(FaultKind)
CLIENTS = st.sampled_from(["ann", "ben", "cem"])


def after(*events: Event, now_s: float = 0.0) -> Safety:
    state = Safety()
    for event in events:
        state, _ = step(state, event, now_s)
    return state


ARMED = after(Arm("ann", 1.0))


class Rig(RuleBasedStateMachine):
    """Any order of events at any times, next to a lease kept by hand."""

    def __init__(self) -> None:
        super().__init__()
        self.safety = Safety()
        self.now_s = 0.0
        self.renewed_s = -1e9
        self.lease_s = 0.0
        self.latched = False

    def feed(self, event: Event) -> tuple[Any, ...]:
        before = self.safety
        self.safety, effects = step(before, event, self.now_s)
        if before.state == "tripped" and not isinstance(event, Reset):
            assert self.safety.state == "tripped", "only a reset ends a trip"
        if before.state == "tripped" and self.safety.state != "tripped":
            assert self.safety.state == "disarmed"
        if before.state != "armed" and self.safety.state == "armed":
            assert isinstance(event, Arm), "nothing but arming arms"
        if before != self.safety and before.state != self.safety.state:
            assert any(isinstance(effect, Announce) for effect in effects)
        assert sum(isinstance(effect, Refuse) for effect in effects) <= 1
        return effects

    @rule(passed_s=st.floats(0.0, 3.0))
    def time_passes(self, passed_s: float) -> None:
        self.now_s += passed_s
        self.feed(Tick())

    @rule(client=CLIENTS, lease_s=st.floats(0.1, 2.0), keep_model=st.booleans())
    def arm(self, client: str, lease_s: float, keep_model: bool) -> None:
        effects = self.feed(Arm(client, lease_s, keep_model=keep_model))
        if not any(isinstance(effect, Refuse) for effect in effects):
            self.renewed_s, self.lease_s = self.now_s, lease_s
            assert self.safety.keeps_model_from("") is keep_model
            assert not self.safety.keeps_model_from(client)

    @rule(client=CLIENTS)
    def renew(self, client: str) -> None:
        if not any(isinstance(effect, Refuse) for effect in self.feed(Renew(client))):
            assert client == self.safety.owner
            self.renewed_s = self.now_s

    @rule(client=CLIENTS)
    def disarm(self, client: str) -> None:
        owner = self.safety.owner if self.safety.may_render(self.now_s) else None
        self.feed(Disarm(client))
        if owner is not None:
            assert (self.safety.state == "stopping") == (client == owner)

    @rule(client=CLIENTS)
    def stop(self, client: str) -> None:
        effects = self.feed(Stop(client))
        assert not any(isinstance(effect, Refuse) for effect in effects)
        assert not self.safety.energised

    @rule(client=CLIENTS)
    def vanish(self, client: str) -> None:
        self.feed(ClientVanished(client))
        assert self.safety.owner != client

    @rule(kind=st.sampled_from(KINDS))
    def fault(self, kind: FaultKind) -> None:
        effects = self.feed(FaultRaised(kind, "injected"))
        if kind in LATCHING:
            assert self.safety.state == "tripped"
        assert len([e for e in effects if isinstance(e, Tripped)]) <= 1

    @rule(kind=st.sampled_from(KINDS))
    def clear(self, kind: FaultKind) -> None:
        self.feed(FaultCleared(kind))

    @rule()
    def quiet(self) -> None:
        self.feed(OutputQuiet())

    @rule()
    def reset(self) -> None:
        self.feed(Reset())

    @invariant()
    def output_needs_a_fresh_lease(self) -> None:
        if self.safety.may_render(self.now_s):
            assert self.safety.state == "armed"
            assert self.now_s < self.renewed_s + self.lease_s + 1e-9
            assert not self.safety.lasting
        assert not self.safety.may_render(self.renewed_s + self.lease_s + 1e-6)

    @invariant()
    def device_is_off_unless_armed(self) -> None:
        assert self.safety.energised == (self.safety.state == "armed")
        assert (self.safety.owner is not None) == (self.safety.state == "armed")
        assert self.safety.state == "armed" or not self.safety.keep_model

    @invariant()
    def there_is_a_way_back_to_zero(self) -> None:
        state = self.safety
        for event in (Stop("anybody"), OutputQuiet()):
            state, _ = step(state, event, self.now_s)
        assert state.state in ("disarmed", "tripped")
        for kind in KINDS:
            state, _ = step(state, FaultCleared(kind), self.now_s)
        state, _ = step(state, Reset(), self.now_s)
        assert state.state == "disarmed"
        state, _ = step(state, Arm("dan", 1.0), self.now_s)
        assert state.state == "armed"


TestRig = Rig.TestCase
TestRig.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)


def test_lease_ends_without_renewal() -> None:
    state, effects = step(ARMED, Tick(), 0.999)
    assert state.state == "armed"
    state, effects = step(state, Tick(), 1.0)
    assert state.state == "stopping"
    assert effects == (Announce(),)


def test_late_renewal_does_not_revive_a_lease() -> None:
    state, effects = step(ARMED, Renew("ann"), 1.0)
    assert state.state == "stopping"
    assert [e.code for e in effects if isinstance(e, Refuse)] == ["not_armed"]


@pytest.mark.parametrize("event", [Arm("ben", 1.0), Disarm("ben"), Renew("ben")])
def test_only_the_owner_decides(event: Event) -> None:
    state, effects = step(ARMED, event, 0.5)
    assert state == ARMED
    assert [e.code for e in effects if isinstance(e, Refuse)] == ["not_owner"]


@pytest.mark.parametrize("kind", sorted(LASTING))
def test_lasting_faults_suspend_and_clear(kind: FaultKind) -> None:
    state, _ = step(ARMED, FaultRaised(kind, "cable"), 0.1)
    assert not state.may_render(0.2)
    state, _ = step(state, FaultCleared(kind), 0.2)
    assert not state.lasting
    assert state.may_render(0.3) == (kind == "sensor")


def test_a_fault_that_is_over_is_shown_only_where_it_ended_the_lease() -> None:
    lasts, _ = step(ARMED, FaultRaised("sensor", "cable"), 0.1)
    assert lasts.fault == ("sensor", "cable")
    assert step(lasts, FaultCleared("sensor"), 0.2)[0].fault is None
    stopped, _ = step(lasts, Stop("ann"), 0.2)
    assert step(stopped, FaultCleared("sensor"), 0.3)[0].fault == ("sensor", "cable")
    lost, _ = step(lasts, FaultRaised("link_lost", "network"), 0.2)
    assert step(lost, FaultCleared("link_lost"), 0.3)[0].fault == ("link_lost", "network")


def test_transient_faults_change_nothing() -> None:
    assert step(ARMED, FaultRaised("transient", "read timeout"), 0.1)[0] == ARMED


@pytest.mark.parametrize("kind", ["device_lost", "stream_lost"])
def test_reset_waits_for_the_device(kind: FaultKind) -> None:
    lost, _ = step(ARMED, FaultRaised(kind, "unplugged"), 0.1)
    state, effects = step(lost, Reset(), 0.2)
    assert state == lost
    assert [e.code for e in effects if isinstance(e, Refuse)] == ["unavailable"]
    back, _ = step(lost, FaultCleared(kind), 0.3)
    assert step(back, Reset(), 0.4)[0].state == "disarmed"


def test_a_reset_shows_the_fault_that_lasts() -> None:
    state = after(FaultRaised("sensor", "cable"), FaultRaised("safety", "monitor"))
    assert state.fault == ("safety", "monitor")
    reset, _ = step(state, Reset(), 0.2)
    assert (reset.state, reset.fault) == ("disarmed", ("sensor", "cable"))
    cleared, _ = step(reset, FaultCleared("sensor"), 0.3)
    assert step(cleared, Arm("ann", 1.0), 0.4)[0].state == "armed"


def test_first_cause_of_a_trip_stays_visible() -> None:
    state = after(FaultRaised("safety", "monitor"), FaultRaised("internal", "afterwards"))
    assert state.fault == ("safety", "monitor")
    _, effects = step(state, Arm("ann", 1.0), 0.0)
    assert isinstance(effects[0], Refuse)
    assert "monitor" in effects[0].message
    assert ACTIONS["safety"] in effects[0].message


def test_arming_anew_counts_as_another_arming() -> None:
    again = step(replace(ARMED, state="disarmed", owner=None), Arm("ann", 1.0), 5.0)[0]
    assert again.armings == ARMED.armings + 1
    assert step(ARMED, Arm("ann", 2.0), 0.5)[0].armings == ARMED.armings


def test_every_fault_says_what_to_do() -> None:
    assert set(ACTIONS) == set(KINDS)
