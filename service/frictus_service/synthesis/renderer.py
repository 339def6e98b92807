"""From predicted motion to screen volts."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from frictus.textures import Scene
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis import kernel
from frictus_service.synthesis.compensation import Inverse, Invertible, as_inverse
from frictus_service.synthesis.compensator import Ends, Inverter
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.scene import CompiledExcitation, CompiledScene, compile_scene

Playable = CompiledScene | CompiledExcitation

RAMP_S = 0.02
"""At contact, arming and stop."""
RELEASE_S = 0.005
"""Where the finger is lifted, and nobody feels it."""
FADE_S = 0.02
"""To another scene or excitation, to what inverts it, or both."""
STREAM_FADE_S = 0.005
"""Between updates of a stream, whose bias does not change."""


@dataclass(frozen=True, slots=True)
class Rendered:
    """One rendered block; the arrays are the renderer's own and valid until the next block.

    Attributes
    ----------
    voltage_v, drive, target_n : ndarray, shape (n_samples,)
        Screen volts; drive fraction, in [0, 1]; friction that was aimed at, bias included, N,
        NaN where none is: in an excitation, and while there is no output.
    clipped_samples, extrapolated_samples : int
        Samples whose drive did not fit, and whose speed lay outside the law's range.
    level : float
        Output envelope after the block, 0 to 1.
    """

    voltage_v: FloatArray
    drive: FloatArray
    target_n: FloatArray
    clipped_samples: int
    extrapolated_samples: int
    level: float


class _Voice(NamedTuple):
    """What is played, and what turns its target into drive; a fade goes from one to another."""

    scene: Playable
    inverter: Inverter


class Renderer:
    """Renders the scene or plays the excitation in force.

    Parameters
    ----------
    law : FrictionLaw or Inverse
        What is undone; a law alone where it has no effects.
    screen : Screen
        Its peak voltage, carrier and size.
    sample_rate_hz : float
        Samples per second of the device's clock.
    block_samples : int
        Samples of every block.
    scene : CompiledScene or CompiledExcitation, optional
        To begin with; a smooth scene if not given.
    began_sample : float
        Device sample at which the law came into force: a drift counts from there.
    """

    def __init__(
        self,
        law: Invertible,
        screen: Screen,
        sample_rate_hz: float,
        block_samples: int,
        scene: Playable | None = None,
        began_sample: float = 0.0,
    ) -> None:
        inverse = as_inverse(law)
        self._screen = screen
        self._rate_hz = sample_rate_hz
        self._voice = _Voice(
            scene or compile_scene(Scene(), inverse, screen, sample_rate_hz),
            Inverter(inverse, sample_rate_hz, block_samples, began_sample),
        )
        self._next_voice: _Voice | None = None
        self._waiting: _Voice | None = None
        self._share = 0.0
        self._level = 0.0
        self._target = np.zeros(block_samples + 1)
        self._target_next = np.zeros(block_samples + 1)
        self._target_moved = np.zeros(block_samples + 1)
        self._drive = np.zeros(block_samples)
        self._drive_next = np.zeros(block_samples)
        self._voltage = np.zeros(block_samples)
        nothing = np.zeros(block_samples)
        self._silence = Rendered(nothing, nothing, np.full(block_samples, np.nan), 0, 0, 0.0)

    @property
    def scene(self) -> Playable:
        """What is in force, or the newest that will be."""
        return self._newest.scene

    @property
    def inverse(self) -> Inverse:
        """What is undone, or the newest that will be."""
        return self._newest.inverter.inverse

    @property
    def _newest(self) -> _Voice:
        return self._waiting or self._next_voice or self._voice

    def set_scene(self, scene: Playable) -> None:
        """Cross-fade to a scene or an excitation, starting with the next block.

        A fade that is under way ends first, within 20 ms; of what comes meanwhile, and before
        one block, the newest wins. So it is with `set_inverse` and `set_model`.

        Parameters
        ----------
        scene : CompiledScene or CompiledExcitation
            What is played.
        """
        self._fade_to(self._newest._replace(scene=scene))

    def set_inverse(self, inverse: Inverse) -> None:
        """Cross-fade to what undoes something else; scenes stay as they were compiled.

        Parameters
        ----------
        inverse : Inverse
            Such as `inverse_in_mode` returns.
        """
        newest = self._newest
        inverter = self._inverter_of(inverse, newest.inverter.began_sample)
        self._fade_to(newest._replace(inverter=inverter))

    def set_model(self, inverse: Inverse, scene: Playable, began_sample: float) -> None:
        """Cross-fade to another model and what was compiled for it, together.

        Parameters
        ----------
        inverse : Inverse
            Of the model.
        scene : CompiledScene or CompiledExcitation
            Compiled for it.
        began_sample : float
            Device sample at which the model came into force: a drift counts from there.
        """
        self._fade_to(_Voice(scene, self._inverter_of(inverse, began_sample)))

    def _inverter_of(self, inverse: Inverse, began_sample: float) -> Inverter:
        return Inverter(inverse, self._rate_hz, self._drive.size, began_sample)

    def _fade_to(self, voice: _Voice) -> None:
        if self._share > 0.0:
            self._waiting = voice
        else:  # no block has been rendered with what was to come
            self._next_voice = voice

    def render(
        self,
        first_sample: int,
        course: PredictedMotion,
        allow: bool,
        lifted: bool = False,
    ) -> Rendered:
        """Render the block that starts to play at `first_sample`.

        Nothing is computed while there is no output. What is felt depends on the sample and on
        the finger alone, so that nothing is missing when the output comes back.

        Parameters
        ----------
        first_sample : int
            Device index of its first sample.
        course : PredictedMotion
            Predicted motion of the block.
        allow : bool
            Whether there may be output; the envelope ramps towards it within 20 ms.
        lifted : bool
            Whether there may not because nothing touches; the ramp then takes 5 ms.
        """
        self._before = (
            self._level,
            self._share,
            self._voice,
            self._next_voice,
            self._waiting,
        )
        if self._level == 0.0:
            for voice in (self._voice, self._next_voice or self._voice):
                voice.inverter.settle()
            if not allow:
                self._go_on_fading()
                return self._silence
        clipped, extrapolated = self._compose(first_sample, course)
        self._go_on_fading()
        # A little steeper, so that rounding does not cost a block more.
        step = (1.0 + 1e-9) / ((RELEASE_S if lifted else RAMP_S) * self._rate_hz)
        self._level = kernel.envelope(self._level, 1.0 if allow else 0.0, step, self._drive)
        kernel.modulate(
            self._drive,
            first_sample,
            self._screen.peak_v,
            self._screen.carrier_hz,
            self._rate_hz,
            self._voltage,
        )
        return Rendered(
            self._voltage,
            self._drive,
            self._target[:-1],
            clipped,
            extrapolated,
            self._level,
        )

    def take_back(self) -> None:
        """Undo the last block, which was not played: ramp and fades go on from before it."""
        (
            self._level,
            self._share,
            self._voice,
            self._next_voice,
            self._waiting,
        ) = self._before

    def _compose(self, first_sample: int, course: PredictedMotion) -> tuple[int, int]:
        """Write drive and target, all fades included; return clipped and extrapolated samples.

        Between scenes with the same inverse the target fades, so that its inverse is exact.
        Elsewhere the drives fade: each is in [0, 1], so that their mixture is, and friction
        follows it in proportion. An excitation has no target.
        """
        now, coming = self._voice, self._next_voice
        if coming is None:
            return self._drive_of(now, first_sample, course, self._target, self._drive)
        step = self._fade_step(now, coming)
        before, after = now.scene, coming.scene
        if (
            now.inverter is coming.inverter
            and isinstance(before, CompiledScene)
            and isinstance(after, CompiledScene)
        ):
            self._trace(before, course, first_sample, self._target)
            self._trace(after, course, first_sample, self._target_next)
            kernel.mix(self._target, self._target_next, self._share, step)
            bias_n = self._bias_n(before, after, step)
            return now.inverter.drive(first_sample, course, bias_n, self._target, self._drive)
        old = self._drive_of(now, first_sample, course, self._target, self._drive)
        new = self._drive_of(coming, first_sample, course, self._target_next, self._drive_next)
        kernel.mix_drive(self._drive, self._drive_next, self._share, step)
        kernel.mix(self._target, self._target_next, self._share, step)
        return max(old[0], new[0]), max(old[1], new[1])

    def _fade_step(self, now: _Voice, coming: _Voice) -> float:
        """Return how much further a fade is after each sample."""
        streamed = (
            now.inverter is coming.inverter
            and now.scene.source == coming.scene.source == "stream"
        )
        return 1.0 / ((STREAM_FADE_S if streamed else FADE_S) * self._rate_hz)

    def _go_on_fading(self) -> None:
        """Let a block's time pass for the fade that is under way, if there is one."""
        coming = self._next_voice
        if coming is None:
            return
        self._share += self._drive.size * self._fade_step(self._voice, coming)
        if self._share >= 1.0:
            self._voice, self._next_voice, self._waiting = coming, self._waiting, None
            self._share = 0.0

    def _drive_of(
        self,
        voice: _Voice,
        first_sample: int,
        course: PredictedMotion,
        target: FloatArray,
        out: FloatArray,
    ) -> tuple[int, int]:
        """Write the target and the drive that one voice asks for by itself."""
        scene = voice.scene
        if isinstance(scene, CompiledScene):
            self._trace(scene, course, first_sample, target)
            steady = scene.arrays.bias_n, scene.arrays.bias_n
            return voice.inverter.drive(first_sample, course, steady, target, out)
        kernel.excite(
            scene.table,
            scene.hz,
            scene.amplitude,
            scene.phase_rad,
            first_sample,
            self._rate_hz,
            out,
        )
        target[:] = np.nan
        return 0, 0

    def _bias_n(self, scene: CompiledScene, coming: CompiledScene, step: float) -> Ends:
        """Return the bias while one scene fades into another, at both ends of the block."""
        before, after = scene.arrays.bias_n, coming.arrays.bias_n
        end = min(self._share + self._drive.size * step, 1.0)
        first, last = (d * d * (3.0 - 2.0 * d) for d in (self._share, end))
        return before + first * (after - before), before + last * (after - before)

    def _trace(
        self, scene: CompiledScene, course: PredictedMotion, first_sample: int, out: FloatArray
    ) -> None:
        """Write what a scene feels like along a course."""
        motion = _one_longer(course.motion, self._drive.size)
        if course.left is None:
            kernel.target_friction(scene.arrays, motion, first_sample, self._rate_hz, out)
            return
        left = _one_longer(course.left, self._drive.size)
        kernel.target_friction(scene.arrays, left, first_sample, self._rate_hz, out)
        kernel.target_friction(
            scene.arrays, motion, first_sample, self._rate_hz, self._target_moved
        )
        kernel.mix(out, self._target_moved, 0.0, 1.0 / self._drive.size)


def _one_longer(motion: BlockMotion, n_samples: int) -> BlockMotion:
    """Return a motion over one sample more; it is linear beyond its end too."""
    longer = (n_samples + 1) / n_samples
    return motion._replace(
        vx_1=motion.vx_0 + longer * (motion.vx_1 - motion.vx_0),
        vy_1=motion.vy_0 + longer * (motion.vy_1 - motion.vy_0),
    )
