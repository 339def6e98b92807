"""What a rig and one finger are, declared: simulated here, predicted in `prediction`.

Effects (`frictus_hardware.physics.effects`) extend a simulator; nothing here knows one of them.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from frictus_hardware.physics.disturbances import AddHum, AddStickSlip, Hum, StickSlip
from frictus_hardware.physics.drive_path import DriveMap, FilterDrive, MapDrive
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.mobility import Mobility
from frictus_hardware.physics.mount import Mount
from frictus_hardware.physics.schedule import Schedule
from frictus_hardware.physics.screen import Screen
from frictus_hardware.physics.skin import DelayedSkin, NonlinearSkin, SkinLaw
from frictus_hardware.physics.stages import (
    Contact,
    Decimate,
    Drive,
    FrictionResponse,
    MountResponse,
    Skin,
    ZeroOrderHold,
)
from frictus_hardware.physics.twin import Stage, Twin


@dataclass(frozen=True, slots=True)
class Simulator:
    """A rig and one finger.

    Attributes
    ----------
    law : FrictionLaw
        Gain, cutoff and its slope with speed.
    mobility : Mobility
        Mass, damping and stiffness of the skin.
    mount, normal_mount : TransferFunction or None
        The true ones, along and into the screen.
    response : {'friction', 'mobility'}
        Which response the model describes: its channel is the one that a delay makes late.
    hold_s : float
        How long the converter holds a sample.
    schedule : Schedule
        What gain and cutoff depend on besides.
    excess_order : float
        By which the friction response falls faster than with first order.
    drive_map : DriveMap
        Static, before `drive_filter`.
    drive_filter : TransferFunction or None
        From drive fraction to drive fraction.
    delay_s, skin_delay_s : float
        By which drive and skin channel are late, and nobody said so.
    stick_slip : tuple of StickSlip
        Oscillations of the friction; none by default.
    hum : tuple of Hum
        Lines of the mains in the force channel; none by default.
    skin : SkinLaw
        What the skin does beyond `mobility`.
    """

    law: FrictionLaw = field(default_factory=FrictionLaw)
    mobility: Mobility = field(default_factory=Mobility)
    mount: TransferFunction | None = Mount().lateral
    normal_mount: TransferFunction | None = Mount().normal
    response: Literal["friction", "mobility"] = "friction"
    hold_s: float = 5e-5
    schedule: Schedule = field(default_factory=Schedule)
    excess_order: float = 0.0
    drive_map: DriveMap = field(default_factory=DriveMap)
    drive_filter: TransferFunction | None = None
    delay_s: float = 0.0
    skin_delay_s: float = 0.0
    stick_slip: tuple[StickSlip, ...] = ()
    hum: tuple[Hum, ...] = ()
    skin: SkinLaw = field(default_factory=SkinLaw)

    def twin(
        self,
        screen: Screen,
        friction_coefficient: float,
        sensors: tuple[Stage, ...] = (),
        minutes: float = 0.0,
        seed: int = 0,
        first_sample: int = 0,
    ) -> Twin:
        """Return the twin: the standard one, with stages for what is declared besides.

        Parameters
        ----------
        screen : Screen
            Its peak voltage, carrier and size.
        friction_coefficient : float
            Of finger and glass without drive.
        sensors : tuple of Stage
            At the device's rate.
        minutes : float
            Since the session began, throughout.
        seed : int
            Of the phases of what is locked to nothing.
        first_sample : int
            Device index of the first sample that the twin will see.
        """
        starts = np.random.default_rng(seed).random(len(self.hum) + len(self.stick_slip))
        hum_starts, slip_starts = np.split(starts, [len(self.hum)])
        stages: list[Stage] = [
            ZeroOrderHold(),
            Drive(screen),
            *self._drive_path(screen, first_sample),
            FrictionResponse(self.law, self.schedule, self.excess_order, self.delay_s, minutes),
            *map(AddStickSlip, self.stick_slip, slip_starts.tolist()),
            Contact(friction_coefficient),
            MountResponse(self.mount, self.normal_mount),
            *self._skin(minutes),
            Decimate(),
            *map(AddHum, self.hum, (2.0 * np.pi * hum_starts).tolist()),
            *sensors,
        ]
        return Twin(tuple(stages))

    def _drive_path(self, screen: Screen, first_sample: int) -> list[Stage]:
        path: list[Stage] = []
        if self.drive_map != DriveMap():
            path.append(MapDrive(self.drive_map, screen.carrier_hz, first_sample))
        if self.drive_filter is not None:
            path.append(FilterDrive(self.drive_filter))
        return path

    def _skin(self, minutes: float) -> list[Stage]:
        swings: list[Stage] = [Skin(self.mobility)]
        if self.skin != SkinLaw():
            swings = [NonlinearSkin(self.mobility, self.skin, self.law, minutes)]
        return [*swings, DelayedSkin(self.skin_delay_s)] if self.skin_delay_s else swings
