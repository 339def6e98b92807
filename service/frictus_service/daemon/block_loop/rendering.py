"""What the block loop renders, scene, model and compensation, and how these change.

Changes are left in the loop's inbox by other threads. What was chosen for an arming ends with
it: once its ramp is out, the standing scene and the model in force are rendered again.
"""

import math
from collections.abc import Callable

from frictus_hardware.base import Backend
from frictus_service.config import Config
from frictus_service.daemon.control import Interlock
from frictus_service.daemon.inboxes import (
    CompensationUpdate,
    LoopInbox,
    ModelUpdate,
    SceneUpdate,
)
from frictus_service.daemon.safety import Safety
from frictus_service.synthesis.chain import Chain
from frictus_service.synthesis.compensability import screen_of
from frictus_service.synthesis.compensation import Inverse
from frictus_service.synthesis.estimator import EstimatorTuning, FingerEstimator
from frictus_service.synthesis.renderer import Renderer


class LoopRendering:
    """The chain of a rig, with what it renders in force.

    Parameters
    ----------
    backend : Backend
        Open.
    config : Config
        Of the service.
    interlock : Interlock
        Holds the safety state.
    inbox : LoopInbox
        With the model to begin with.
    now_s : callable
        Monotonic clock, s.

    Attributes
    ----------
    chain : Chain
        Renders and exchanges; a new one begins with no output and no finger.
    stream_stale : bool
        Whether a stream's updates stopped coming, so that what comes after it is rendered.
    """

    def __init__(
        self,
        backend: Backend,
        config: Config,
        interlock: Interlock,
        inbox: LoopInbox,
        now_s: Callable[[], float],
    ) -> None:
        self._backend = backend
        self._model_since_s = now_s()
        self._interlock = interlock
        self._inbox = inbox
        self._now_s = now_s
        self._tuning = EstimatorTuning(stale_s=1e-3 * config.limits.finger_stale_ms)
        self._block_samples = config.block_samples
        self._screen = screen_of(backend.info)
        self._rate_hz = backend.info.sample_rate_hz
        self._playing: SceneUpdate | None = None
        self._standing: SceneUpdate | None = None
        self._early: SceneUpdate | None = None  # its arming began within the block
        self._compensation: CompensationUpdate | None = None
        self.stream_stale = False
        self.chain = self._new_chain()

    @property
    def estimator(self) -> FingerEstimator:
        """The finger, as the chain follows it."""
        return self._estimator

    def begin_anew(self) -> None:
        """Render the standing scene with a new chain: of what was before, nothing is known."""
        self._stand()
        self.chain = self._new_chain()

    def end_arming(self) -> None:
        """Render the standing scene, from zero on; the device has ramped."""
        self._stand()
        self.chain.renderer = self._new_renderer()

    def update(self, safety: Safety, now_s: float, energised: bool) -> None:
        """Take what waits in the inbox, and end what has ended.

        Parameters
        ----------
        safety : Safety
            The state of this block.
        now_s : float
            Of the same clock as the updates.
        energised : bool
            Whether the device is armed.
        """
        if self._playing is not None and self._playing.ended(safety):
            # What it was for ended before the device was armed: no ramp is under way.
            self.end_arming()
        self._take_compensation(energised)
        change = self._inbox.model.take(safety, energised)
        if change is not None:
            self._put_in_force(change, safety, now_s, energised)
        self._take_scenes(safety)
        playing = self._playing
        if playing is not None and now_s > playing.until_s and playing.afterwards is not None:
            after = playing.afterwards
            self._play(SceneUpdate(after, math.inf, after, playing.arming))
            self.stream_stale = True

    def _put_in_force(
        self, change: ModelUpdate, safety: Safety, now_s: float, energised: bool
    ) -> None:
        """Render with another model; while there is output, with a cross-fade."""
        # What waits was made for the former model, and nothing newer can be there yet.
        self._inbox.standing.clear()
        self._inbox.scene.clear()
        self._inbox.compensation.clear()
        self._compensation = None
        self._model_since_s = now_s
        self._playing = self._standing = SceneUpdate(change.scene)
        self._early, self.stream_stale = None, False
        if change.stream is not None and change.stream.early(safety):
            self._early = change.stream
        elif change.stream is not None and not change.stream.ended(safety):
            self._playing = change.stream
        change.done.set()
        if not energised:
            self.chain.renderer = self._new_renderer()
        if energised or self._playing is not self._standing:
            self.chain.renderer.set_model(
                change.model.inverse, self._playing.scene, self._model_began_sample()
            )

    def _take_scenes(self, safety: Safety) -> None:
        """Take the scene that stands, and then what is to be played, over it or itself."""
        if self._inbox.standing:
            self._standing = self._inbox.standing.popleft()
            if self._playing is None or self._playing.standing:
                self._play(self._standing)
        coming = self._inbox.scene.popleft() if self._inbox.scene else self._early
        self._early = None
        if coming is None:
            return
        if coming.early(safety):
            self._early = coming
        elif not coming.ended(safety):
            self._play(coming)

    def _take_compensation(self, energised: bool) -> None:
        """Take up a mode that was chosen, or forget one that ended before the device was armed.

        One that ends while the output is on goes with the renderer, after the ramp.
        """
        if self._inbox.compensation:
            self._compensation = self._inbox.compensation.popleft()
        elif (
            self._compensation is None
            or energised
            or not self._compensation.ended(self._interlock.state)
        ):
            return
        self.chain.renderer.set_inverse(self._inverse_in_force())

    def _stand(self) -> None:
        self._playing = self._standing
        self.stream_stale = False

    def _play(self, update: SceneUpdate) -> None:
        self._playing = update
        self.chain.renderer.set_scene(update.scene)
        self.stream_stale = False
        if update.standing:
            self._standing = update

    def _new_chain(self) -> Chain:
        self._estimator = FingerEstimator(self._rate_hz, self._tuning)
        renderer = self._new_renderer()
        return Chain(self._backend, self._estimator, renderer, self._block_samples)

    def _new_renderer(self) -> Renderer:
        return Renderer(
            self._inverse_in_force(),
            self._screen,
            self._rate_hz,
            self._block_samples,
            None if self._standing is None else self._standing.scene,
            self._model_began_sample(),
        )

    def _inverse_in_force(self) -> Inverse:
        """Return what the owner chose to undo, and the model once that arming is over."""
        chosen = self._compensation
        if chosen is None or chosen.ended(self._interlock.state):
            self._compensation = None
            return self._inbox.model.in_force.inverse
        return chosen.inverse

    def _model_began_sample(self) -> float:
        """Return when the model came into force, in samples of the device's present run.

        A drift counts from there: through armings, and through a device lost and found.
        """
        in_force_s = self._now_s() - self._model_since_s
        return self._backend.next_play_sample - in_force_s * self._backend.info.clock_hz
