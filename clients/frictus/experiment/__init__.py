"""Psychophysics on a rig: tasks, procedures, fits, and a log that no crash takes away.

>>> import frictus
>>> from frictus.experiment import Amplitude, Experiment, LevelRange, QuestPlusPlan
>>> from frictus.experiment import TwoAlternatives
>>> ridges = Amplitude(texture=frictus.Spectrum(components=[...]))
>>> plan = QuestPlusPlan(levels=LevelRange(low=0.001, high=0.1))
>>> with frictus.connect() as client:
...     rig = client.rig("rig1")
...     with Experiment(rig, TwoAlternatives(), plan, ridges, log="p01.jsonl") as experiment:
...         experiment.run(participant)
"""

from frictus.experiment.events import events_table, write_events
from frictus.experiment.experiment import Experiment
from frictus.experiment.participant import Participant, VirtualParticipant
from frictus.experiment.presentation import PresentedInterval, ScaledError
from frictus.experiment.procedures.next_level import QuestPlus, Staircase
from frictus.experiment.procedures.orders import latin_square
from frictus.experiment.procedures.plans import (
    ConstantPlan,
    LevelRange,
    QuestPlusPlan,
    StaircasePlan,
)
from frictus.experiment.procedures.schedule import ScheduledTrial
from frictus.experiment.protocol import (
    Design,
    Presentation,
    Protocol,
    load_protocol,
    parse_protocol,
    ready_protocols,
)
from frictus.experiment.psychometrics.fitting import Estimate, PsychometricFit, fit
from frictus.experiment.psychometrics.observers import SimulatedObserver
from frictus.experiment.psychometrics.psychometric import ParameterGrid, probability
from frictus.experiment.psychometrics.results import ConditionResult, results
from frictus.experiment.stimuli import Amplitude, Difference, NamedTexture, Pairs
from frictus.experiment.tasks import (
    Adjustment,
    Magnitude,
    SameDifferent,
    TwoAlternatives,
    YesNo,
)
from frictus.experiment.trial_log import read_log

__all__ = [
    "Adjustment",
    "Amplitude",
    "ConditionResult",
    "ConstantPlan",
    "Design",
    "Difference",
    "Estimate",
    "Experiment",
    "LevelRange",
    "Magnitude",
    "NamedTexture",
    "Pairs",
    "ParameterGrid",
    "Participant",
    "Presentation",
    "PresentedInterval",
    "Protocol",
    "PsychometricFit",
    "QuestPlus",
    "QuestPlusPlan",
    "SameDifferent",
    "ScaledError",
    "ScheduledTrial",
    "SimulatedObserver",
    "Staircase",
    "StaircasePlan",
    "TwoAlternatives",
    "VirtualParticipant",
    "YesNo",
    "events_table",
    "fit",
    "latin_square",
    "load_protocol",
    "parse_protocol",
    "probability",
    "read_log",
    "ready_protocols",
    "results",
    "write_events",
]
