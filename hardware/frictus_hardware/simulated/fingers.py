"""The virtual fingers a simulated rig may have."""

from typing import Annotated

from pydantic import Field

from frictus_hardware.simulated.guided import GuidedStrokes
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.pointer import ClientFinger
from frictus_hardware.simulated.strokes import SinusoidalStrokes, SteadyStrokes

FingerConfig = Annotated[
    SteadyStrokes | SinusoidalStrokes | HumanStrokes | ClientFinger | GuidedStrokes,
    Field(discriminator="kind"),
]
