"""The tracker as a part of the service, beside a rig with a person whom nobody measured."""

import contextlib
import json
import os
import signal
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.service.tracking.served import (
    PATIENCE_S,
    PERSON,
    config_in,
    first,
    follows,
    playing,
)

import frictus
from frictus.errors import RefusedError, SilenceError
from frictus.keys import Topics
from frictus.messages import AdaptationPolicy, EstimateState
from frictus.model import FirstOrderSpeedLaw, Model
from frictus_hardware.physics.linear import Mount
from frictus_hardware.simulated.config import ParticipantEffect
from frictus_service.calibration.coordinates import Prior
from frictus_service.registry.store import Registry
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.tracking.audit import ModelChangeLog
from frictus_service.tracking.live import LiveTracker
from frictus_service.tracking.policy import ANOTHER_FINGER, WATCHED_WINDOWS

pytestmark = pytest.mark.long


def cutoff_at_40(model: Model) -> float:
    law = model.base
    assert isinstance(law, FirstOrderSpeedLaw)
    return law.cutoff_0_hz + 40.0 * law.slope_hz_per_mm_s


@pytest.mark.timeout(300)
def test_the_model_follows_the_finger_and_is_put_back(tmp_path: Path) -> None:
    config = config_in(tmp_path, "adapt")
    with playing(config, "tracker") as (_, rig):
        begun = rig.model()
        state = first(rig, follows)
        change = state.changes[0]
        assert change.etag_before == begun.etag
        assert change.before.gain_n == pytest.approx(0.39, rel=1e-3)
        assert change.after.gain_n == pytest.approx(PERSON.gain_n, rel=0.05)
        model = rig.model()
        assert model.adapted_from is not None
        assert "dB off" in change.reason
        assert not model.model.placeholder
        assert cutoff_at_40(model.model) == pytest.approx(1700.0, rel=0.1)
        assert rig.status().state == "armed"  # nothing was interrupted
        assert rig.status().adaptations >= len(state.changes)
        rig.set_adaptation("observe", undo=True)
        assert rig.model().model == begun.model
        assert rig.status().adaptation == "observe"
        state = first(rig, lambda told: told.model_etag == begun.etag)
        assert state.changes[-1].etag_after == begun.etag
        assert state.windows > 0  # what was learned is kept
    lines = [json.loads(line) for line in config.tracker.audit.read_text().splitlines()]
    assert [line["etag_after"] for line in lines] == [c.etag_after for c in state.changes]
    assert Model.model_validate(lines[0]["model_before"]) == begun.model
    assert Model.model_validate(lines[0]["model_after"]).provenance["source"] == "live"


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGSTOP")
@pytest.mark.timeout(300)
@pytest.mark.parametrize("policy", ["observe", "adapt"])
def test_a_tracker_that_stands_still_or_dies_leaves_the_rig_as_it_is(
    tmp_path: Path, policy: AdaptationPolicy
) -> None:
    with playing(config_in(tmp_path, policy), "tracker") as (supervisor, rig):
        if policy == "adapt":
            first(rig, follows)
        pid = supervisor.pid_of("tracker")
        with rig.watch(Topics.ESTIMATE, timeout_s=PATIENCE_S) as states:
            next(states)
            os.kill(pid, signal.SIGSTOP)
            with rig.blocks("voltage", timeout_s=PATIENCE_S) as blocks:
                for _ in range(100):  # what it had asked for has long been answered
                    next(blocks)
                before = rig.model()
                states.drain()
                played = sum(isinstance(next(blocks), frictus.Block) for _ in range(300))
            assert played > 0
            assert rig.model().etag == before.etag
            os.kill(pid, signal.SIGCONT)
            next(states)  # it goes on by itself
            os.kill(pid, signal.SIGKILL)
            before = rig.model()
            states.drain()
            after = next(states)  # another one has taken its place
        assert isinstance(after, EstimateState)
        assert rig.model().etag == before.etag  # it may have been told again, with a stamp
        assert bool(before.adapted_from) is (policy == "adapt")
        assert after.windows < WATCHED_WINDOWS
        assert rig.status().state == "armed"


@pytest.mark.timeout(300)
def test_who_moves_to_another_rig_brings_the_finger_and_not_the_rig(tmp_path: Path) -> None:
    """Learned where the force comes 150 us late, published, and set where it does not."""
    late = ParticipantEffect(id="channel_delay", parameters={"delay_s": 150e-6})
    nobody = placeholder_model().model_copy(update={"participant": "P07"})

    def felt_enough(told: EstimateState) -> bool:
        return told.law is not None and told.windows >= 80

    here = config_in(tmp_path, rig="here", person=PERSON.model_copy(update={"effects": [late]}))
    with playing(here, "tracker", model=nobody) as (_, rig):
        learned = first(rig, felt_enough)
    assert learned.law is not None
    assert learned.model is not None
    assert learned.law.delay_us.value == pytest.approx(150.0, abs=10.0)
    assert "delay" in learned.alarms
    with Registry(here.registry.url) as registry:
        registry.publish(learned.model, "P07", by="test", rig="here")
        brought = registry.get("P07").model

    with playing(config_in(tmp_path, rig="there"), "tracker", model=brought) as (_, rig):
        arrived = first(rig, lambda told: told.law is not None)
        settled = first(rig, felt_enough)
    assert arrived.law is not None
    assert settled.law is not None
    assert arrived.participant == settled.participant == "P07"
    # The finger is known from the first half second of sliding on, and stays who it is.
    assert arrived.windows <= 40
    assert PERSON.gain_n == pytest.approx(arrived.law.gain_n.value, rel=0.03)
    # What was brought stays known, and what is felt adds to it, whatever the first strokes are.
    beforehand = Prior.of_person(brought, Prior.weak()).covariance
    known = (arrived.law.cutoff_20_hz, arrived.law.cutoff_100_hz)
    for now, variance in zip(known, np.diag(beforehand), strict=False):
        assert np.log(now.high / now.low) < 2.0 * 1.96 * np.sqrt(variance)
    assert settled.new_fingers == 0
    # The rig is not: its delay is its own, and no alarm says that it lacks that of the other.
    assert abs(settled.law.delay_us.value) < 10.0
    assert settled.alarms == ()
    assert settled.error_db["in_force"] < 0.2


@pytest.mark.timeout(300)
def test_what_cannot_be_written_down_is_not_done(tmp_path: Path) -> None:
    """A change that is not in the audit is the last."""
    config = config_in(tmp_path, "adapt")
    in_the_way = tmp_path / "file"
    in_the_way.write_text("not a folder")
    told = list[EstimateState]()
    changed = threading.Event()

    def tell(state: EstimateState) -> None:
        told.append(state)
        if state.changes and "cannot be written down" in state.held_back:
            changed.set()

    with (
        playing(config) as (_, rig),
        LiveTracker(
            rig,
            Mount().lateral,
            Prior.weak(),
            tell,
            ModelChangeLog(in_the_way / "changes.jsonl"),
        ) as live,
    ):
        live.follow(changed.is_set)
    assert len(told[-1].changes) == 1


@pytest.mark.timeout(300)
def test_another_finger_brings_back_the_model_that_was_set(tmp_path: Path) -> None:
    told = list[EstimateState]()
    back = threading.Event()
    with playing(config_in(tmp_path, "adapt")) as (_, rig):
        begun = rig.model()

        def tell(state: EstimateState) -> None:
            told.append(state)
            if len(state.changes) == 1:
                live.tracker.new_fingers += 1
            elif len(state.changes) > 1:
                back.set()

        with LiveTracker(rig, Mount().lateral, Prior.weak(), tell) as live:
            live.follow(back.is_set)
        change = told[-1].changes[1]
        assert change.etag_after == begun.etag
        assert change.reason == ANOTHER_FINGER
        assert change.utc_ns - told[-1].changes[0].utc_ns >= 1.9e9
        assert rig.model().model == begun.model
        assert rig.status().state == "armed"


@pytest.mark.timeout(300)
def test_what_a_tracker_may_not_do_the_rig_refuses(tmp_path: Path) -> None:
    with playing(config_in(tmp_path)) as (_, rig):
        now = rig.model()
        with pytest.raises(RefusedError, match="observe"):
            rig.adapt(now.model, now.etag, "because")
        assert rig.model().etag == now.etag


@pytest.mark.timeout(300)
@pytest.mark.parametrize(("channels", "rate_hz"), [(1, 20_000.0), (3, 1_000.0)])
def test_blocks_that_are_not_the_rigs_do_not_end_it(
    tmp_path: Path, channels: int, rate_hz: float
) -> None:
    config, told = config_in(tmp_path), list[EstimateState]()
    with (
        playing(config) as (_, rig),
        frictus.connect(config.router.endpoint, "stranger") as stranger,
    ):
        newest = next(item for item in rig.blocks("force") if isinstance(item, frictus.Block))
        forged = replace(
            newest,
            sequence=newest.sequence + 1_000_000,
            first_sample=newest.first_sample + 40_000,
            sample_rate_hz=rate_hz,
            data=np.full((channels, 200), np.inf, np.float32),
        )

        def tell(state: EstimateState) -> None:
            told.append(state)
            stranger.session.put(rig.keys.of(Topics.FORCE), forged.pack())

        with (
            LiveTracker(rig, None, Prior.weak(), tell) as live,
            contextlib.suppress(SilenceError),
        ):
            live.follow(lambda: len(told) > 8)
        # The rig's own blocks look repeated now: whoever begins anew hears them again.
        begun = len(told)
        with LiveTracker(rig, None, Prior.weak(), told.append) as live:
            live.follow(lambda: len(told) > begun + 2)
    assert told[-1].law is None or np.isfinite(told[-1].law.gain_n.value)
