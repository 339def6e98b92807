"""The compiled twin beside itself as plain Python, over all people that it may simulate."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.plain import compared, few

from frictus_hardware import SimulatedConfig
from frictus_hardware.errors import ConfigError
from frictus_hardware.physics import compiled, friction, skin
from frictus_hardware.physics.effects import EFFECTS
from frictus_hardware.simulated import kernels
from frictus_hardware.simulated.clock import VirtualClock
from frictus_hardware.simulated.config import ParticipantEffect, SimulatedParticipant
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.rig import SimulatedRig

pytestmark = pytest.mark.compiled

FEW = settings(max_examples=few(5))  # as plain Python takes long
effect = st.sampled_from(sorted(EFFECTS)).flatmap(
    lambda name: st.builds(
        lambda values: ParticipantEffect(id=name, parameters=values),
        st.fixed_dictionaries(
            {each.name: st.floats(each.low, each.high) for each in EFFECTS[name].parameters}
        ),
    )
)
participant = st.builds(
    SimulatedParticipant,
    gain_n=st.floats(1e-3, 10.0),
    cutoff_0_hz=st.floats(1.0, 1e4),
    slope_hz_per_mm_s=st.floats(0.0, 1e3),
    mass_kg=st.floats(1e-4, 0.1),
    damping_n_s_m=st.floats(1e-2, 100.0),
    stiffness_n_m=st.floats(1.0, 1e5),
    friction_coefficient=st.floats(0.0, 5.0),
    effects=st.lists(effect, max_size=2, unique_by=lambda each: each.id).map(tuple),
)


@FEW
@given(participant, st.integers(0, 2**31), st.integers(0, 2**32 - 1))
def test_what_a_simulated_rig_senses(
    person: SimulatedParticipant, seed: int, drive_seed: int
) -> None:
    config = SimulatedConfig(
        clock="virtual", finger=HumanStrokes(), participant=person, seed=seed
    )
    rng = np.random.default_rng(drive_seed)
    with compared(compiled, friction, skin, kernels) as watched:
        try:
            rig = SimulatedRig(config, clock=VirtualClock())
        except ConfigError:
            return
        rig.open()
        rig.arm()
        for _ in range(3):
            rig.exchange(rng.uniform(-80.0, 80.0, 40))
        rig.close()
    assert watched["explore"].calls
