"""Find a detection threshold: two intervals, one with a texture, QUEST+ chooses the amplitude.

The observer is simulated and feels the friction of the simulated rig: the program runs by
itself. Put a class of your own with the same methods in its place. Every trial is on the disk
before the next begins: stop the program, start it again, and it goes on.
"""

import sys
from contextlib import closing

import frictus
from frictus.experiment import (
    Amplitude,
    Design,
    Experiment,
    LevelRange,
    Presentation,
    QuestPlusPlan,
    SimulatedObserver,
    TwoAlternatives,
    VirtualParticipant,
    results,
    write_events,
)

ROUTER = sys.argv[1] if len(sys.argv) > 1 else frictus.DEFAULT_ROUTER
RIDGES = Amplitude(  # of 1 N, so that levels are newtons
    texture=frictus.Spectrum(components=[frictus.Component(amplitude_n=1.0, cycles_per_mm=0.5)])
)
TASK = TwoAlternatives(question="Which interval had a texture?")
PLAN = QuestPlusPlan(levels=LevelRange(low=0.001, high=0.1), trials=16)

with frictus.connect(ROUTER) as client:
    rig = client.rig("rig1")
    observer = VirtualParticipant(rig, TASK, SimulatedObserver(), seed=1)
    experiment = Experiment(
        rig,
        TASK,
        PLAN,
        RIDGES,
        log="detection-01.jsonl",
        presentation=Presentation(interval_s=0.3, gap_s=0.05, fade_s=0.05),
        design=Design(practice=2),
        seed=1,
    )
    with closing(observer), experiment:
        experiment.run(observer)
        rows = experiment.rows
for row in rows:
    if "trial" in row:
        print(f"{row['level']:.4f} N, rendered {row['level_rendered']:.4f}: {row['correct']}")
for result in results(experiment.protocol, rows):
    assert result.fit is not None
    threshold = result.fit.threshold
    print(f"threshold {threshold.value:.4f} N ({threshold.low:.4f} to {threshold.high:.4f})")
print("events:", *write_events(rows, folder="."))
