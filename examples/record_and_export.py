"""Record a rig for three seconds, read the recording, and export it for MATLAB.

The recorder of `frictus serve` writes the file; this program runs on the same machine.
"""

import sys
import time
from pathlib import Path

import frictus
from frictus.keys import STREAMS
from frictus_service.recording.export import export_study
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.samples import Samples
from frictus_service.recording.segments import TrialDeclaration
from frictus_service.study.export import export_matlab
from frictus_service.study.importers import open_study

ROUTER = sys.argv[1] if len(sys.argv) > 1 else frictus.DEFAULT_ROUTER
NAME = f"example-{time.time_ns()}"

with frictus.connect(ROUTER) as client:
    rig = client.rig("rig1")
    rig.record(NAME, participant="P01", notes="an example")
    time.sleep(3.0)
    state = rig.end_recording()
print(f"{state.blocks} blocks, {state.lost_blocks} lost, in {state.path}")

recording = Path(str(state.path))
counts: dict[str, int] = {}
reader = RecordingReader(recording)
for item in reader.items():
    if isinstance(item, Samples):
        suffix = STREAMS[item.stream].suffix
        counts[suffix] = counts.get(suffix, 0) + item.data.shape[1]
print(f"reading: {reader.ending}")
for suffix, samples in sorted(counts.items()):
    print(f"{suffix}: {samples} samples")

# Nobody was guided, so that a person has to say what the trial was.
declared = TrialDeclaration(speed_mm_s=60.0, force_n=0.4, tones_hz=())
export_study(recording, recording.with_suffix(".h5"), declared, mount=None)
with open_study(recording.with_suffix(".h5")) as study:
    export_matlab(study, recording.with_suffix(""))
print(f"for MATLAB: {recording.with_suffix('')}")
