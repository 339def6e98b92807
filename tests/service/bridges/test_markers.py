"""Events are changes of what a rig says."""

from typing import Any

from frictus.messages import Applied, Fault, GuidanceState, SceneState
from frictus.textures import Scene
from frictus_service.bridges.markers import Marker, MarkerDetector

APPLIED = Applied(
    gain=1.0,
    feasible_gain=1.0,
    bias=0.3,
    bias_n=0.1,
    scaled=False,
    speed_range_mm_s=(0.0, 300.0),
)


def texts(markers: list[Marker]) -> list[str]:
    return [marker.text for marker in markers]


def test_a_status_tells_state_run_and_fault_once(hand: Any) -> None:
    detector = MarkerDetector()
    status = hand.status(utc_ns=5)
    assert texts(detector.markers_of(status)) == ["run 1", "state disarmed"]
    assert detector.markers_of(status.model_copy(update={"utc_ns": 6})) == []
    fault = Fault(kind="sensor", reason="silent", utc_ns=7, action="look")
    tripped = status.model_copy(update={"state": "tripped", "fault": fault, "utc_ns": 9})
    assert detector.markers_of(tripped) == [
        Marker(9, "state tripped"),
        Marker(7, "fault sensor: silent"),
    ]
    assert texts(detector.markers_of(status)) == ["state disarmed", "fault cleared"]


def test_scenes_and_trials() -> None:
    detector = MarkerDetector()
    scene = SceneState(etag="s1", scene=Scene(name="paper"), applied=APPLIED, utc_ns=3)
    assert detector.markers_of(scene) == [Marker(3, "scene s1 paper")]
    played = scene.model_copy(update={"etag": "s2", "source": "excitation"})
    assert texts(detector.markers_of(played)) == ["scene excitation s2 paper"]
    guidance = GuidanceState(
        utc_ns=8,
        participant="p07",
        phase="record",
        trial=3,
        seconds_left=2.0,
        target_speed_mm_s=50.0,
        target_force_n=0.4,
        reference_x_mm=10.0,
        span_mm=(5.0, 90.0),
    )
    assert detector.markers_of(guidance) == [Marker(8, "trial 3 record")]
    assert detector.markers_of(guidance.model_copy(update={"utc_ns": 9})) == []
