"""A rig of one's own: a cable from the output to the monitor, and a finger that rests.

A backend moves blocks and keeps the output within its limit; the daemon does all else. What
each method promises stands in `frictus_hardware.base.Backend`, and
`tests/hardware/test_contract.py` holds every backend to it. To have the daemon open it, give it
a configuration, a `RigConfig` with a `kind` of its own, and name that in
`frictus_hardware/__init__.py`.
"""

import numpy as np

from frictus_hardware.arguments import ramp_samples, require_drive
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Backend, Exchange, Opened, RigInfo, TouchReport, Truth
from frictus_hardware.errors import ClosedError
from frictus_hardware.output import RETURN_S, OutputQueue

RATE_HZ, LEAD, PEAK_V = 20_000.0, 400, 75.0
MAX_BLOCK = 20_000
PLACE_MM = (35.0, 20.0)


class CableRig(Opened):
    """See `Backend`; its time passes as fast as blocks are exchanged."""

    def __init__(self) -> None:
        self._open = False
        self._begin()

    def _begin(self) -> None:
        """Set everything to what holds at sample 0, the lead prefilled with zeros."""
        self._armed = False
        self._sensed = 0
        self._output = OutputQueue(4 * MAX_BLOCK, False, ramp_samples(RETURN_S, RATE_HZ))
        self._output.write(0, np.zeros(LEAD), 0)

    @property
    def info(self) -> RigInfo:
        """What does not change while the backend is open."""
        return RigInfo("cable", True, "simulated", RATE_HZ, LEAD, PEAK_V, (70.0, 40.0), 0.0)

    @property
    def next_play_sample(self) -> int:
        """Device index at which the next drive handed over will start to play."""
        return self._sensed + LEAD

    def open(self) -> None:
        """Start the sample clock with the lead prefilled with zeros; disarmed."""
        if not self._open:
            self._begin()
        self._open = True

    def arm(self) -> None:
        """Allow output other than zero."""
        self._require_open()
        self._armed = True

    def exchange(self, drive_v: FloatArray) -> Exchange:
        """Hand over the next block of output; return as many sensed samples."""
        self._require_open()
        require_drive(drive_v, MAX_BLOCK, armed=self._armed)
        clamped = np.clip(drive_v, -PEAK_V, PEAK_V)
        first, play, n_samples = self._sensed, self.next_play_sample, drive_v.size
        _, applied_v = self._output.write(play, clamped, first)
        self._sensed += n_samples
        force_n = np.zeros((n_samples, 3))
        force_n[:, 2] = 0.4  # the finger rests
        return Exchange(
            first_sample=first,
            force_n=force_n,
            accel_m_s2=np.zeros((n_samples, 3)),
            voltage_v=self._output.read(first, n_samples),
            touches=(TouchReport(float(first), *PLACE_MM, in_contact=True),),
            applied_v=applied_v,
            play_sample=play,
            clipped_samples=int(np.count_nonzero(clamped != drive_v)),
            margin_samples=LEAD,
            truth=Truth(
                position_mm=np.tile(PLACE_MM, (n_samples, 1)),
                velocity_mm_s=np.zeros((n_samples, 2)),
                friction_n=np.zeros(n_samples),
                normal_force_n=force_n[:, 2],
                in_contact=np.ones(n_samples, dtype=np.bool_),
            ),
        )

    def stop(self, ramp_s: float) -> None:
        """Ramp what is queued to zero within `ramp_s`, drop the rest, and disarm."""
        self._output.ramp(self._sensed, ramp_samples(ramp_s, RATE_HZ))
        self._armed = False

    def health(self) -> str | None:
        """Return what is wrong with the device, or None."""
        return None if self._open else "not open"

    def close(self) -> None:
        """Bring the output to zero and release the device."""
        self.stop(0.0)
        self._open = False

    def _require_open(self) -> None:
        if not self._open:
            raise ClosedError("the rig is not open; open it first")


def main() -> None:
    """Play a tone through the cable, and find it on the monitor one lead later."""
    tone_v = 20.0 * np.sin(2.0 * np.pi * 200.0 * np.arange(1_000) / RATE_HZ)
    rig: Backend
    with CableRig() as rig:
        rig.arm()
        played = rig.exchange(tone_v)
        heard = rig.exchange(np.zeros(1_000))
        monitor_v = np.concatenate([played.voltage_v, heard.voltage_v])
        late = int(np.argmax(np.correlate(monitor_v, tone_v, "valid")))
        print(f"the tone comes back after {late} samples; the lead is {rig.info.lead_samples}")


if __name__ == "__main__":
    main()
