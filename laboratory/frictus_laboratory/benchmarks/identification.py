"""Trials per second through identification, beside a bare read and the obvious pipeline.

The obvious pipeline is identification as one writes it down first, FFTs of each trial and
`curve_fit`. It follows the paper's data processing: axes reduced by DFT321, acceleration
integrated, sweeps where friction is above its mean, 4000 samples in the middle of each, the
nearest bin of their spectra, magnitudes fitted. Its answers are biased; nothing else uses it.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from scipy import integrate, optimize

from frictus_hardware.arrays import FloatArray
from frictus_laboratory.benchmarks.figure import Figure, Target, interleaved, skipped
from frictus_laboratory.reproduction.plan import StudyConditions, plan_study
from frictus_laboratory.reproduction.population import draw_people
from frictus_laboratory.reproduction.simulate import STEPS, simulate_trial, study_info
from frictus_service.identification.pipeline.study import Task, observe_study, read_task
from frictus_service.identification.pipeline.workers import work_through
from frictus_service.study.reader import StudyReader
from frictus_service.study.writer import StudyWriter

WINDOW: Final = 4000


def cutoffs_hz(path: Path) -> dict[tuple[float, float], float]:
    """Return a cutoff per speed and force.

    Parameters
    ----------
    path : Path
        A `study/1` file.
    """
    points: dict[tuple[float, float], list[tuple[float, float]]] = defaultdict(list)
    with h5py.File(path) as file:
        for trial in file["trials"].values():
            asked = trial.attrs
            tone = float(np.ravel(asked["tone_hz"])[0])
            for gain in _gains(trial, tone):
                points[float(asked["speed_mm_s"]), float(asked["force_n"])].append((tone, gain))
    return {condition: _fit(np.array(found)) for condition, found in points.items()}


def _gains(trial: Any, tone_hz: float) -> list[float]:
    rate_hz = float(trial.attrs["sample_rate_hz"])
    voltage, force, accel = (_read(trial[n]) for n in ("voltage_v", "force_n", "accel_m_s2"))
    friction = _dft321(force[:, :2])
    velocity = integrate.cumulative_trapezoid(_dft321(accel), dx=1.0 / rate_hz)
    drive = 2.0 * np.square(voltage / 75.0)
    above = force[:, 0] > force[:, 0].mean()
    edges = np.flatnonzero(np.diff(above.astype(np.int8)))
    gains = []
    for begin, end in pairwise(edges):
        middle = (begin + end) // 2
        if not above[middle] or end - begin < WINDOW:
            continue
        part = slice(middle - WINDOW // 2, middle + WINDOW // 2)
        spectra = [np.abs(np.fft.rfft(each[part])) for each in (drive, friction, velocity)]
        line = round(tone_hz * WINDOW / rate_hz)
        gains.append(float(spectra[1][line] / spectra[0][line]))
    return gains


def _read(data_set: Any) -> FloatArray:
    raw = data_set[()]
    if raw.dtype.kind == "f":
        return np.asarray(raw, dtype=np.float64)
    return np.asarray(raw * data_set.attrs["scale"] + data_set.attrs.get("offset", 0.0))


def _dft321(axes: FloatArray) -> FloatArray:
    spectra = np.fft.rfft(axes, axis=0)
    size = np.sqrt(np.square(np.abs(spectra)).sum(axis=1))
    phase = np.angle(spectra.sum(axis=1))
    reduced: FloatArray = np.fft.irfft(size * np.exp(1j * phase), axes.shape[0])
    return reduced


def _fit(points: FloatArray) -> float:
    def first_order(tone_hz: FloatArray, gain: float, cutoff_hz: float) -> FloatArray:
        return gain / np.sqrt(1.0 + np.square(tone_hz / cutoff_hz))

    if points.shape[0] < 3:
        return float("nan")
    solved = optimize.curve_fit(
        first_order, points[:, 0], points[:, 1], (0.4, 1000.0), maxfev=5000
    )
    return float(solved[0][1])


TRIALS: Final = 8
LARGER: Final = 10
DESIGN: Final = StudyConditions((30.0, 134.4, 446.3, 1097.7), (40.0, 80.0), (0.4,))
MEGA: Final = 1e6


def measure(repeats: int = 5, trials: int = TRIALS, seconds: float = 10.0) -> list[Figure]:
    """Return rate, bytes, gain by a second worker, and memory.

    Parameters
    ----------
    repeats : int
        Of which the median is taken.
    trials : int
        Of the small study; the larger one has ten times as many.
    seconds : float
        Of each trial; the paper's are 10.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        small, large = Path(folder) / "small.h5", Path(folder) / "large.h5"
        write_study(small, trials, seconds)
        write_study(large, LARGER * trials, seconds)
        return [
            *rates(small, trials, repeats),
            _workers(large, repeats),
            _memory(small, large),
        ]


def write_study(path: Path, trials: int, seconds: float) -> None:
    """Write a simulated study; beyond the first few its trials repeat, each as one of its own.

    Parameters
    ----------
    path : Path
        Of the file.
    trials : int
        How many.
    seconds : float
        Of each trial.
    """
    rng = np.random.default_rng(0)
    plans = plan_study(draw_people(1, rng), replace(DESIGN, seconds=seconds), rng)
    made = [simulate_trial(plan) for plan in plans[:trials]]
    with StudyWriter(path, study_info()) as writer:
        for number in range(trials):
            one = made[number % len(made)]
            own = replace(one.info, id=f"t{number}", order=number)
            writer.add(replace(one, info=own), STEPS)


def rates(path: Path, trials: int, repeats: int) -> list[Figure]:
    """Return trials and bytes per second on one core.

    Parameters
    ----------
    path : Path
        Of the file.
    trials : int
        In that study.
    repeats : int
        Of which the median is taken.
    """

    def bare() -> float:
        return _seconds(path.read_bytes)

    def read() -> float:
        with StudyReader(path) as study:
            return _seconds(lambda: [study.read(each.id) for each in study.trials])

    def pipeline() -> float:
        return _seconds(lambda: observe_study(path, workers=0))

    def plain() -> float:
        return _seconds(lambda: cutoffs_hz(path))

    observe_study(path, workers=0)  # compiled, and the file in memory
    bare_s, read_s, pipeline_s, obvious_s = interleaved(repeats, bare, read, pipeline, plain)
    size_mb = path.stat().st_size / MEGA
    return [
        Figure(
            "identification_rate",
            "trials/s",
            {"pipeline": trials / pipeline_s},
            {"obvious": trials / obvious_s, "reading alone": trials / read_s},
            obvious_s / pipeline_s,
            Target("ratio", "at least", 1.0),
            "trials read, checked by hash and observed on one core, beside FFTs of whole "
            "trials with numpy, and curve_fit; ratio: pipeline over obvious",
        ),
        Figure(
            "identification_bytes",
            "MB/s",
            {"pipeline": size_mb / pipeline_s},
            {"bare read": size_mb / bare_s},
            bare_s / pipeline_s,
            None,
            "bytes of the study file on one core, beside reading the same bytes from the "
            "system's memory",
        ),
    ]


def _seconds(work: Callable[[], object]) -> float:
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def _workers(path: Path, repeats: int) -> Figure:
    name, unit = "identification_workers", "trials/s"
    if (os.cpu_count() or 1) < 2:
        return skipped(name, unit, "this machine has one processor")
    with StudyReader(path) as study:
        tasks = [Task(path, each, None) for each in study.trials]
    one, two = interleaved(repeats, lambda: _rate(tasks, 1), lambda: _rate(tasks, 2))
    return Figure(
        name,
        unit,
        {"two": two},
        {"one": one},
        two / one,
        Target("ratio", "at least", 1.5),
        "trials through two worker processes and through one, once they are at work",
    )


def _rate(tasks: list[Task], workers: int) -> float:
    """Return trials per second over the second half, when every worker has long begun."""
    done_s = [
        time.perf_counter() for _ in work_through(read_task, tasks, workers, lambda line: None)
    ]
    half = len(done_s) // 2
    return (len(done_s) - half) / (done_s[-1] - done_s[half - 1])


PEAK: Final = """
import sys
from frictus_service.identification.pipeline.study import observe_study
observe_study(sys.argv[1], workers=0)
(peak,) = [line for line in open("/proc/self/status") if line.startswith("VmHWM")]
print(peak.split()[1])
"""


def _memory(small: Path, large: Path) -> Figure:
    name, unit = "identification_memory", "MB"
    if sys.platform != "linux":
        return skipped(name, unit, "peak memory is read as Linux reports it")
    one, ten = (_peak_mb(path) for path in (small, large))
    return Figure(
        name,
        unit,
        {"large": ten},
        {"small": one},
        ten / one,
        Target("ratio", "at most", 1.2),
        f"peak of a process that observes a study of {large.stat().st_size / MEGA:.0f} MB, and "
        f"one of {small.stat().st_size / MEGA:.0f} MB",
    )


def _peak_mb(path: Path) -> float:
    command = [sys.executable, "-c", PEAK, str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=300.0)
    return int(done.stdout) / 1e3
