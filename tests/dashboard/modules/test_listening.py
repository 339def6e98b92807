"""The friction felt and its target, against the service's own figures."""

import numpy as np
import pytest
from playwright.sync_api import Page

from frictus_hardware.physics.friction import FrictionLaw
from frictus_service.fidelity.preview import CENTRES_HZ, band_power, error_db

pytestmark = pytest.mark.browser

RATE_HZ = 20_000.0
SEGMENT = 8_192


def test_a_spectrogram_of_nothing_is_empty(page: Page) -> None:
    said, painted = page.evaluate(
        """async () => {
          const { Spectrogram } = await import("/listening/spectrogram.js");
          const shown = new Spectrogram(document.createElement("figure"));
          const low = Array(5).fill(new Float32Array(1024).fill(0.2));
          const frame = { raw: true, run: 1, lostSamples: 0, sampleRateHz: 2e4, columns: 1024 };
          shown.push({ ...frame, low });
          shown.draw();
          shown.tell();
          const { width, height } = shown.canvas;
          const { data } = shown.canvas.getContext("2d").getImageData(0, 0, width, height);
          const painted = data.some((value, i) => i % 4 === 3 && value > 0);
          return [shown.strongest.textContent, painted];
        }"""
    )
    assert said == "Nothing is felt now"
    assert not painted


def test_spectrogram_has_a_tone_where_and_as_strong_as_it_is(page: Page) -> None:
    time_s = np.arange(1_024) / RATE_HZ
    bin_hz = RATE_HZ / 1_024
    tone = 0.4 + 0.03 * np.sqrt(2.0) * np.sin(2.0 * np.pi * 12.0 * bin_hz * time_s)
    got = page.evaluate(
        """async (samples) => {
          const { levels } = await import("/listening/spectrogram.js");
          return [...levels(Float64Array.from(samples))];
        }""",
        tone.tolist(),
    )
    assert int(np.argmax(got)) == 12
    assert got[12] == pytest.approx(20.0 * np.log10(0.03), abs=0.01)
    assert max(got[:10] + got[15:]) < -100.0  # neither its mean nor its ends are there


def test_a_finger_that_only_turns_is_not_said_to_rest(page: Page) -> None:
    told = page.evaluate(
        """async () => {
          const { Felt } = await import("/listening/felt.js");
          const felt = new Felt();
          let firstSample = 0;
          const push = (speed, columns) => {
            const low = [0, 0, speed, 0, 0.2].map((v) => new Float32Array(columns).fill(v));
            const frame = { raw: true, run: 1, sampleRateHz: 2e4, firstSample, columns };
            felt.push({ ...frame, low }, null);
            firstSample += columns;
          };
          push(50, 8192 * 2);
          for (let i = 0; i < 20; i++) push(i % 2 ? 50 : -50, 4096);
          const turning = felt.why;
          push(0, 8192 * 4);
          return [turning, felt.why];
        }"""
    )
    assert told == [
        "The finger turns before it has slid for 0.4 s: this is of its last strokes.",
        "The finger does not slide now: this is of its last strokes.",
    ]


def test_what_nobody_looked_at_is_left_out_at_its_length(page: Page) -> None:
    columns, judged = page.evaluate(
        """async () => {
          const { Spectrogram } = await import("/listening/spectrogram.js");
          const { Felt } = await import("/listening/felt.js");
          const [shown, felt] = [new Spectrogram(document.createElement("figure")), new Felt()];
          const judged = [];
          const push = (firstSample, columns) => {
            const values = [0, 0, 50, 0, 0.2];
            const low = values.map((value) => new Float32Array(columns).fill(value));
            // A connection of its own has lost nothing: the first one was closed meanwhile.
            const frame = { raw: true, run: 1, lostSamples: 0, sampleRateHz: 2e4, firstSample };
            for (const each of [shown, felt]) each.push({ ...frame, columns, low }, null);
            judged.push(felt.segments.length);
          };
          push(0, 1500);
          push(1500, 6500);
          push(1024 * 20, 1024);  // 0.6 s later
          push(1024 * 21, 7168);
          push(1024 * 28 + 4e6, 1024);  // minutes later
          return [shown.columns.map((column) => column !== null), judged];
        }"""
    )
    assert judged == [0, 0, 0, 1, 1]  # 8192 samples without a gap, once
    # Of ten seconds nothing but the newest column is left.
    assert columns == [False] * 195 + [True]


def test_a_short_gap_is_as_wide_as_it_was(page: Page) -> None:
    columns = page.evaluate(
        """async () => {
          const { Spectrogram } = await import("/listening/spectrogram.js");
          const shown = new Spectrogram(document.createElement("figure"));
          const frame = { raw: true, lostSamples: 0, sampleRateHz: 2e4, columns: 1024 };
          const low = Array(5).fill(new Float32Array(1024).fill(0.2));
          for (const [run, firstSample] of [[1, 0], [1, 1024], [1, 1024 * 7 + 10], [2, 0]]) {
            shown.push({ ...frame, low, run, firstSample });
          }
          return shown.columns.map((column) => column !== null);
        }"""
    )
    assert columns == [True, True, *[False] * 5, True, False, True]


def test_third_octaves_are_those_of_the_service(page: Page, rng: np.random.Generator) -> None:
    felt = np.cumsum(rng.normal(size=SEGMENT)) * 1e-3 + rng.normal(size=SEGMENT)
    target = rng.normal(size=SEGMENT)
    got = page.evaluate(
        """async ([felt, target, rate]) => {
          const { bandPower, errorsDb } = await import("/listening/spectrum.js");
          const [a, b] = [felt, target].map((x) => bandPower(Float64Array.from(x), rate));
          return { felt: [...a], target: [...b], errors: errorsDb(a, b) };
        }""",
        [felt.tolist(), target.tolist(), RATE_HZ],
    )
    powers = [band_power(x, RATE_HZ, [slice(0, SEGMENT)]) for x in (felt, target)]
    np.testing.assert_allclose(got["felt"], powers[0], rtol=1e-9)
    np.testing.assert_allclose(got["target"], powers[1], rtol=1e-9)
    errors = [np.nan if error is None else error for error in got["errors"]]
    np.testing.assert_allclose(errors, error_db(*powers), atol=1e-8)


def test_uncompensated_is_what_the_model_lets_through(
    page: Page, rng: np.random.Generator
) -> None:
    law = FrictionLaw(
        gain_n=1.0, cutoff_0_hz=rng.uniform(50, 500), slope_hz_per_mm_s=rng.uniform(0, 20)
    )
    speed = rng.uniform(20.0, 100.0)
    got = page.evaluate(
        """async ([law, speed]) => {
          const { uncompensated } = await import("/listening/spectrum.js");
          return [...uncompensated(new Float64Array(16).fill(1), law, -speed)];
        }""",
        [{"cutoff_0_hz": law.cutoff_0_hz, "slope_hz_per_mm_s": law.slope_hz_per_mm_s}, speed],
    )
    cutoff_hz = law.cutoff_0_hz + law.slope_hz_per_mm_s * speed
    np.testing.assert_allclose(got, np.abs(1.0 / (1.0 + 1j * CENTRES_HZ / cutoff_hz)) ** 2)


def test_target_follows_the_path(page: Page, rng: np.random.Generator) -> None:
    angle_deg, turns, hz = rng.uniform(-180, 180), rng.uniform(0.2, 5.0), rng.uniform(20, 500)
    phase = rng.uniform(0, 6, size=2)
    amplitude = rng.uniform(0.01, 0.1, size=2)
    x, y = rng.uniform(10, 20, size=(2, 64))
    region = {
        "x_mm": [-1000, 1000],
        "y_mm": [5, 25],
        "gain": 0.7,
        "edge_fade_mm": 1.0,
        "texture": {
            "kind": "spectrum",
            "angle_deg": angle_deg,
            "components": [
                {"amplitude_n": amplitude[0], "cycles_per_mm": turns, "phase_rad": phase[0]},
                {"amplitude_n": amplitude[1], "hz": hz, "phase_rad": phase[1]},
            ],
        },
    }
    aside = {**region, "y_mm": [26, 30]}
    across = {**region, "y_mm": [float(y.mean()), 30]}
    friction, crossing = page.evaluate(
        """async ([regions, across, x, y]) => {
          const { friction, under } = await import("/listening/target.js");
          const path = { x: Float64Array.from(x), y: Float64Array.from(y) };
          const over = under(regions, path);
          return [[...friction(over, path, 40, 2e-4, 20000, 0.5)], under([across], path)];
        }""",
        [[region, aside], across, x.tolist(), y.tolist()],
    )
    along = np.cos(np.deg2rad(angle_deg)) * x + np.sin(np.deg2rad(angle_deg)) * y
    time_s = 40 / 20_000 + 2e-4 * np.arange(64)
    expected = amplitude[0] * np.cos(2 * np.pi * turns * along + phase[0])
    expected += amplitude[1] * np.cos(2 * np.pi * hz * time_s + phase[1])
    np.testing.assert_allclose(friction, 0.35 * expected, atol=1e-12)
    assert crossing is None


def test_sound_that_does_not_come_is_told_and_ends_with_its_rate(page: Page) -> None:
    states = page.evaluate(
        """async () => {
          const { Hearing } = await import("/listening/hearing.js");
          document.body.insertAdjacentHTML("beforeend", `<p id="hearing">
            <button id="hear">Hear the friction</button><input id="volume" type="range">
            <span id="hear-outcome"></span></p>`);
          const button = document.getElementById("hear");
          const outcome = document.getElementById("hear-outcome");
          const { AudioContext } = window;
          let loaded;
          window.AudioContext = class {
            audioWorklet = { addModule: () => new Promise((...ends) => (loaded = ends)) };
            async close() {}
          };
          const sound = new Hearing();
          const states = [];
          const look = () => {
            states.push([button.disabled, button.textContent, outcome.textContent]);
          };
          const frame = (sampleRateHz) => ({ raw: true, sampleRateHz, low: [] });
          look();
          sound.push(frame(2e4));
          button.click();
          document.getElementById("volume").dispatchEvent(new Event("input")); // none plays yet
          look();
          loaded[1](new Error("it cannot be loaded"));
          await new Promise((resolve) => setTimeout(resolve)); // it has been told of
          look();
          button.click();
          sound.push(frame(1e4)); // another rig
          look();
          window.AudioContext = AudioContext;
          document.getElementById("hearing").remove();
          return states;
        }"""
    )
    hear, stop = "Hear the friction", "Stop the sound"
    assert states == [
        [True, hear, ""],
        [False, stop, ""],
        [False, hear, "No sound: it cannot be loaded"],
        [False, hear, ""],
    ]
