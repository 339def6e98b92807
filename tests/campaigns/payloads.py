"""Valid payloads of every key that a client may put or ask, drawn at random."""

import base64
import io
import math
import random
from typing import Any, Final

import numpy as np
from PIL import Image

from frictus.block import Block, Flag
from frictus.keys import CALLS, RECORDER_CALLS, STREAMS, TOPICS, Topic, Topics
from frictus.stream import StreamFrame
from frictus_hardware.physics.effects import EFFECTS

Tree = dict[str, Any]

FORGED_SITE: Final = "forged"
"""Of a status that no rig has published, so that whoever sends it can tell it from the true."""
FORGED_RUN: Final = 0
"""Likewise of blocks."""
ANSWERED: Final = {**CALLS, **RECORDER_CALLS}
PUT: Final = {topic.suffix: topic for topic in TOPICS}
KEYS: Final = (*ANSWERED, *PUT)


def draw_payload(key: str, client: str, utc_ns: int, rng: random.Random) -> Tree | bytes:
    """Return a valid payload of a key: a JSON object, or the bytes of a frame.

    Parameters
    ----------
    key : str
        One of `KEYS`.
    client : str
        In whose name.
    utc_ns : int
        When it is made.
    rng : Random
    """
    if key in ANSWERED:
        head = {"client": client, "utc_ns": utc_ns, "ttl_ms": 5_000}
        return head | _body(ANSWERED[key], utc_ns, rng)
    topic = PUT[key]
    if topic is Topics.TEXTURE:
        return _frame(utc_ns, rng)
    if topic in STREAMS.values():
        return _block(topic, utc_ns, rng)
    return {"client": client, "utc_ns": utc_ns} | _body(topic.message, utc_ns, rng)


def draw_scene(rng: random.Random) -> Tree:
    """Return a scene of one to three regions."""
    return {
        "name": "drawn",
        "regions": [
            {
                "texture": _texture(rng),
                "x_mm": [rng.uniform(-10.0, 30.0), rng.uniform(31.0, 80.0)],
                "y_mm": [-10.0, 50.0],
                "gain": rng.uniform(0.0, 2.0),
                "edge_fade_mm": rng.choice([0.0, 1.0, 5.0]),
            }
            for _ in range(rng.randint(1, 3))
        ],
    }


def _texture(rng: random.Random) -> Tree:
    kind = rng.choice(["spectrum", "profile", "beta", "slope", "map"])
    if kind == "spectrum":
        unit = rng.choice(["cycles_per_mm", "hz"])
        return {"kind": kind, "angle_deg": rng.uniform(-360.0, 360.0)} | {
            "components": [
                {"amplitude_n": rng.uniform(0.0, 0.1), unit: rng.uniform(0.5, 20.0)}
                for _ in range(rng.randint(1, 8))
            ]
        }
    if kind == "profile":
        period = rng.choice([{"period_mm": 10.0}, {"period_s": 0.1}])
        friction = [rng.uniform(-0.1, 0.1) for _ in range(rng.randint(2, 64))]
        return {"kind": kind, "friction_n": friction, **period}
    if kind == "map":
        grey = np.frombuffer(rng.randbytes(256), np.uint8).reshape(16, 16)
        file = io.BytesIO()
        Image.fromarray(grey).save(file, "PNG")
        image = base64.b64encode(file.getvalue()).decode()
        return {"kind": kind, "image_png": image, "black_n": -0.1, "white_n": 0.1}
    shape: Tree = {"kind": kind, "rms_n": rng.uniform(0.01, 0.1), "seed": rng.randint(0, 9)}
    if rng.random() < 0.5:
        shape["speed_mm_s"] = rng.uniform(20.0, 100.0)
    if kind == "beta":
        return shape | {"alpha": rng.uniform(0.5, 9.0), "beta": rng.uniform(0.5, 9.0)}
    return shape | {"peak_hz": 200.0, "low_order": rng.randint(1, 8), "high_order": 2}


def draw_model(rng: random.Random) -> Tree:
    """Return a friction model, with one effect of the catalogue or none."""
    base = {
        "law": "first_order_speed",
        "gain_n": rng.uniform(0.2, 1.0),
        "cutoff_0_hz": rng.uniform(50.0, 500.0),
        "slope_hz_per_mm_s": rng.uniform(-0.3, 2.0),
    }
    effect = rng.choice([*EFFECTS.values(), None])
    effects = []
    if effect is not None:
        drawn = {
            parameter.name: _within(parameter.low, parameter.high, rng)
            for parameter in effect.parameters
        }
        effects.append({"id": effect.id, "parameters": drawn})
    return {"schema": "model/1", "base": base, "effects": effects}


def draw_compensation(rng: random.Random) -> Tree:
    """Return a compensation mode, its speed within what the placeholder model holds for."""
    mode = rng.choice(["model", "fixed", "none"])
    return {"mode": mode} | (
        {"speed_mm_s": rng.uniform(20.0, 100.0)} if mode == "fixed" else {}
    )


def _within(low: float, high: float, rng: random.Random) -> float:
    return rng.uniform(max(low, -1e3), min(high, 1e3)) if low < high else low


def _law_values(rng: random.Random) -> Tree:
    return {
        "gain_n": rng.uniform(0.2, 1.0),
        "cutoff_20_hz": rng.uniform(300.0, 900.0),
        "cutoff_100_hz": rng.uniform(1_000.0, 2_500.0),
    }


def _body(message: str, utc_ns: int, rng: random.Random) -> Tree:
    """Return the fields of a message beside client and time."""
    excitation = {"bias": 0.5, "tones": [{"hz": rng.uniform(1.0, 900.0), "amplitude": 0.1}]}
    bodies: dict[str, Tree] = {
        "Request": {},
        "LeaseRenewal": {},
        "ArmRequest": {
            "lease_ms": rng.randint(100, 10_000),
            "keep_model": rng.random() < 0.1,
        },
        "SceneRequest": {"scene": draw_scene(rng)},
        "OpenStreamRequest": {"peak_n": rng.uniform(0.01, 0.5)},
        "CloseStreamRequest": {"ticket": rng.choice([None, 1])},
        "ModelRequest": {"model": draw_model(rng)},
        "AdaptationRequest": {
            "policy": rng.choice(["observe", "suggest", "adapt"]),
            "undo": rng.random() < 0.5,
        },
        "AdaptRequest": {"model": draw_model(rng), "if_match": "e", "reason": "drawn"},
        "ExciteRequest": {"excitation": excitation},
        "CompensationRequest": {"compensation": draw_compensation(rng)},
        "RecordRequest": {"name": f"drawn-{rng.randint(0, 999)}", "notes": "drawn"},
        "PointerState": {
            "x_mm": rng.uniform(0.0, 70.0),
            "y_mm": rng.uniform(0.0, 35.0),
            "in_contact": rng.random() < 0.8,
        },
        "FingerState": {
            **{name: 1 for name in ("sequence", "sample", "uncertainty_ns", "age_ms")},
            **dict.fromkeys(("x_mm", "y_mm", "vx_mm_s", "vy_mm_s", "normal_force_n"), 1.0),
            **dict.fromkeys(("in_contact", "stale", "extrapolated"), False),
            "source": "simulated",
        },
        "TouchState": {
            "run": FORGED_RUN,
            "sample": 1.0,
            "x_mm": 1.0,
            "y_mm": 1.0,
            "in_contact": True,
            "source": "simulated",
        },
        "GuidanceState": {
            "participant": "p1",
            "phase": rng.choice(["break", "approach", "record", "analyse", "done"]),
            "trial": 1,
            "trials": 10,
            "seconds_left": 1.0,
            "target_speed_mm_s": rng.uniform(10.0, 100.0),
            "target_force_n": rng.uniform(0.1, 1.0),
            "reference_x_mm": 30.0,
            "span_mm": [10.0, 60.0],
        },
        "RecordingState": {"recording": True, "name": "forged", "seconds": 1.0},
        "MarkerState": {"source": "drawn", "text": "stimulus/1"},
        "RigStatus": {
            "site": FORGED_SITE,
            "rig": "rig1",
            "version": "0",
            "run": FORGED_RUN,
            "state": rng.choice(["disarmed", "armed", "stopping", "tripped"]),
            "owner": None,
            "backend": "forged",
            "simulated": True,
            "finger_source": "simulated",
            "sample_rate_hz": 20_000.0,
            "block_samples": 100,
            "lead_ms": 20.0,
            "screen_mm": [70.0, 35.0],
            "screen_peak_v": 75.0,
            "converter_steps": {"force": 0.001},
            "aux": [{"name": "a", "unit": "V"}],
            "model_etag": "e",
            "model_placeholder": True,
            "scene_etag": "e",
            "compensation": draw_compensation(rng),
            "adaptation": rng.choice(["observe", "suggest", "adapt"]),
            "adaptations": rng.randint(0, 9),
            "counters": {"blocks": 1},
            "timing": {"lateness_p50_ms": 0.1},
        },
        "SceneState": {
            "etag": "e",
            "scene": draw_scene(rng),
            "applied": {
                **{name: 1.0 for name in ("gain", "feasible_gain", "bias", "bias_n")},
                "scaled": False,
                "speed_range_mm_s": [10.0, 100.0],
            },
        },
        "ModelState": {
            "etag": "e",
            "model": draw_model(rng),
            "adapted_from": rng.choice(["d", None]),
            "reason": "drawn",
        },
        "TimeState": {
            "run": FORGED_RUN,
            "sample": 1,
            "ns_per_sample": 50_000.0,
            "uncertainty_ns": 1_000,
            "skew_ppm": 0.0,
            "utc_steps": 0,
        },
        "EstimateState": {
            "run": FORGED_RUN,
            "windows": 10,
            "refused": {"the finger turns": 1},
            "participant": "p1",
            "in_force_etag": "e",
            "law": {
                name: {"value": value, "low": 0.9 * value, "high": 1.1 * value}
                for name, value in (
                    ("gain_n", 0.4),
                    ("cutoff_20_hz", 600.0),
                    ("cutoff_100_hz", 1_700.0),
                    ("delay_us", 10.0),
                )
            },
            "in_force": _law_values(rng),
            "points": [
                {
                    "speed_mm_s": rng.uniform(10.0, 150.0),
                    "centre_hz": rng.uniform(20.0, 1_000.0),
                    "gain_n": 0.3,
                    "half_width_db": 0.2,
                    "phase_deg": rng.uniform(-180.0, 0.0),
                }
                for _ in range(rng.randint(0, 128))
            ],
            "bands": [{"centre_hz": 100.0, "ratio_db": 0.1, "half_width_db": 0.1}],
            "error_db": {"newest": 0.1},
            "gain_nats": {"in_force": 1.0, "newest": 12.0},
            "evidence": {"gain": rng.uniform(-5.0, 50.0), "unknown": 0.0},
            "alarm_nats": 7.6,
            "alarms": ["gain"],
            "advice": {"gain": "calibrate again: gain is 12 % off"},
            "policy": rng.choice(["observe", "suggest", "adapt"]),
            "held_back": "the interval is too wide",
            "changes": [
                {
                    "utc_ns": utc_ns,
                    "etag_before": "d",
                    "etag_after": "e",
                    "before": _law_values(rng),
                    "after": _law_values(rng),
                    "reason": "drawn",
                }
                for _ in range(rng.randint(0, 16))
            ],
        },
    }
    return bodies[message]


def _frame(utc_ns: int, rng: random.Random) -> bytes:
    samples = rng.choice([2, 64, 4_096])
    phase = np.linspace(0.0, 2.0 * math.pi, samples, endpoint=False)
    return StreamFrame(
        ticket=rng.getrandbits(31),
        sequence=rng.getrandbits(20),
        utc_ns=utc_ns,
        ttl_ms=1_000,
        period=rng.uniform(0.1, 10.0),
        spatial=rng.random() < 0.5,
        angle_deg=0.0,
        friction_n=(0.01 * np.sin(phase)).astype(np.float32),
    ).pack()


def _block(topic: Topic, utc_ns: int, rng: random.Random) -> bytes:
    (number,) = (number for number, each in STREAMS.items() if each is topic)
    data = np.frombuffer(rng.randbytes(600), np.int8).astype(np.float32).reshape(3, 200)
    return Block(
        stream=number,
        run=FORGED_RUN,
        sequence=rng.getrandbits(20),
        first_sample=rng.getrandbits(30),
        utc_ns=utc_ns,
        uncertainty_ns=1_000,
        sample_rate_hz=20_000.0,
        flags=Flag.SIMULATED,
        data=data,
    ).pack()
