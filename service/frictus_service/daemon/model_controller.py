"""Which friction model is in force: one that was set, adapted to the finger, or put back."""

import math
from collections.abc import Callable
from typing import Final

from frictus.errors import RefusedError, TextureError
from frictus.keys import spoken_name
from frictus.messages import (
    AdaptationPolicy,
    AdaptationRequest,
    AdaptRequest,
    ModelRequest,
    ModelState,
    Reply,
)
from frictus.model import Model
from frictus_hardware.physics.screen import Screen
from frictus_service.command_validation import check_match
from frictus_service.daemon.control import Interlock
from frictus_service.daemon.inboxes import LoopInbox, ModelUpdate, RenderedModel
from frictus_service.daemon.scene_controller import SceneController
from frictus_service.json_text import etag_of
from frictus_service.synthesis.compensability import inverse_of_model
from frictus_service.tracking.adaptation import ADAPT_EVERY_S, change_of, check_adapted

MODEL_CHANGE_S: Final = 1.0
"""Within which the loop must have taken up a new model; it takes one block."""
OTHER_VOLTAGE: Final = 1.1
"""Full drive beyond what a model was measured at by more than this factor is remarked on."""


class ModelController:
    """Has the loop render with another model. Used by the thread of its `SceneController`.

    The properties may be read by any.

    Parameters
    ----------
    screen : Screen
        Its peak voltage, carrier and size.
    interlock : Interlock
        Holds the safety state.
    orders : LoopInbox
        With the model to begin with.
    stage : SceneController
        What is rendered, and has to be compiled anew for another model.
    monotonic_s : callable
        Monotonic clock, s.
    policy : {'observe', 'suggest', 'adapt'}
        What a tracker may do with the model, to begin with.
    say : callable
        Called with a line for the operator about each change while it may be felt.
    """

    def __init__(
        self,
        screen: Screen,
        interlock: Interlock,
        orders: LoopInbox,
        stage: SceneController,
        monotonic_s: Callable[[], float],
        policy: AdaptationPolicy = "observe",
        say: Callable[[str], None] = lambda _line: None,
    ) -> None:
        self._screen = screen
        self._interlock = interlock
        self._orders = orders
        self._stage = stage
        self._monotonic_s = monotonic_s
        self._say = say
        self._as_set = orders.model.in_force
        self._changed_s = -math.inf
        self.policy: AdaptationPolicy = policy
        """What a tracker may do with the model."""
        self.adaptations = 0
        """How often the model was adapted since it was set."""

    @property
    def model(self) -> ModelState:
        """The model that the loop renders with."""
        return self._orders.model.in_force.state

    def set_model(self, request: ModelRequest) -> Reply:
        """Replace the model; the standing scene is compiled anew for it.

        Parameters
        ----------
        request : ModelRequest
            As a client sent it.

        Raises
        ------
        RefusedError
            `conflict` while not disarmed or where the etag differs, `not_feasible`.
        """
        self._stage.check_owner(request.client)
        check_match(request.if_match, self.model.etag, "model")
        if self._interlock.state.state != "disarmed":
            raise RefusedError("conflict", "the model changes only while disarmed")
        model = self._rendered(request.model)
        reply = self._put_in_force(model)
        self._as_set, self.adaptations = model, 0
        return reply

    def adapt(self, request: AdaptRequest) -> Reply:
        """Have gain and cutoff follow the finger; what is felt meanwhile cross-fades.

        Parameters
        ----------
        request : AdaptRequest
            As a tracker sent it; it needs no lease.

        Raises
        ------
        RefusedError
            `conflict` unless the policy is `adapt`, the etag is that in force, and a scene or
            a stream plays by the model; `not_owner` where the owner keeps the model;
            `unavailable` within 2 s of the last change; `not_feasible` for what is no
            adaptation of the model that was set; `tripped`.
        """
        if self.policy != "adapt":
            raise RefusedError(
                "conflict",
                f"the adaptation policy of this rig is {self.policy!r}: whoever may calibrate "
                "sets it to 'adapt' first",
            )
        before = self.model
        check_match(request.if_match, before.etag, "model")
        self._check_replaceable("")
        since_s = self._monotonic_s() - self._changed_s
        if not since_s >= ADAPT_EVERY_S:
            raise RefusedError(
                "unavailable",
                f"the model changed {since_s:.1f} s ago: it is adapted at most every "
                f"{ADAPT_EVERY_S:g} s",
            )
        check_adapted(request.model, before.model, self._as_set.state.model)
        model = self._rendered(request.model, before.etag, request.reason)
        reply = self._put_in_force(model, fades=True)
        self.adaptations += 1
        why = " ".join(request.reason.split())
        change = change_of(before.model, model.state.model)
        self._say(f"the model follows the finger: {change}" + (f" ({why})" if why else ""))
        return reply

    def choose_policy(self, request: AdaptationRequest) -> Reply:
        """Choose what a tracker may do, and put the model back that was set if asked to.

        Parameters
        ----------
        request : AdaptationRequest
            As a client sent it; it needs no lease.

        Raises
        ------
        RefusedError
            Of what is to be undone alone, and nothing is changed then: `conflict` while an
            excitation or another compensation mode plays, `not_owner` where another client
            keeps the model; `tripped`.
        """
        before = self.model
        if request.undo and before is not self._as_set.state:
            self._check_replaceable(request.client)
            self._put_in_force(self._as_set, fades=True, client=request.client)
            self.adaptations = 0
            change = change_of(before.model, self.model.model)
            self._say(f"the model is as it was set, as {request.client} asked: {change}")
        self.policy = request.policy
        return Reply(ok=True, etag=self.model.etag, adaptation=self.policy)

    def _check_replaceable(self, client: str) -> None:
        """Refuse where a model must not change while it may be felt."""
        safety = self._interlock.state
        if safety.state == "tripped":
            raise RefusedError("tripped", "the rig is tripped: its model stays as it is")
        if safety.keeps_model_from(client):
            raise RefusedError(
                "not_owner",
                f"{spoken_name(safety.owner)} holds the rig and keeps its model until the "
                "lease ends",
            )
        if self._stage.scene.source == "excitation":
            raise RefusedError(
                "conflict", "an excitation is played: the model changes once it has ended"
            )
        if self._stage.compensation.mode != "model":
            raise RefusedError(
                "conflict",
                f"the compensation mode is {self._stage.compensation}: the model changes once "
                "it is 'model' again",
            )

    def _rendered(
        self, model: Model, adapted_from: str | None = None, reason: str = ""
    ) -> RenderedModel:
        try:
            rendered = rendered_model(model, self._screen)
        except TextureError as error:
            raise RefusedError("not_feasible", str(error)) from error
        told = {"adapted_from": adapted_from, "reason": reason}
        return RenderedModel(rendered.state.model_copy(update=told), rendered.inverse)

    def _put_in_force(
        self, model: RenderedModel, fades: bool = False, client: str = ""
    ) -> Reply:
        """Have the loop render with a model and what is compiled for it, or nothing of it."""
        try:
            scenes = self._stage.compiled_for(model.inverse)
        except TextureError as error:
            raise RefusedError("not_feasible", str(error)) from error
        order = ModelUpdate(model, scenes.compiled, scenes.update, fades, client)
        self._orders.model.offer(order)
        if not order.done.wait(MODEL_CHANGE_S) and self._orders.model.withdraw(order):
            raise RefusedError(
                "conflict",
                "the rig stands still, or its owner keeps the model; try again"
                if fades
                else "the rig is armed or stands still; try again",
            )
        order.done.wait()  # it is in force; the loop is about to say so
        self._stage.keep(scenes)
        self._changed_s = self._monotonic_s()
        applied, said = scenes.state.applied, remarks_on(model, self._screen)
        return Reply(ok=True, etag=model.state.etag, message=said, applied=applied)


def rendered_model(model: Model, screen: Screen) -> RenderedModel:
    """Return a model with what is undone for it on a screen.

    Raises
    ------
    TextureError
        If it is not one of friction, or an effect has a parameter out of its range.
    """
    inverse = inverse_of_model(model, screen)
    state = ModelState(etag=etag_of(model), model=model, not_rendered=inverse.not_rendered)
    return RenderedModel(state, inverse)


def remarks_on(model: RenderedModel, screen: Screen) -> str:
    """Return in words what of a model a screen does not make good, or only within limits.

    Friction per drive fraction is that of the screen on which it was measured: it goes with the
    square of the voltage of full drive.
    """
    inverse, (low_v, high_v) = model.inverse, model.state.model.validity.drive_vpp
    full_v = 2.0 * screen.peak_v
    fits = low_v / OTHER_VOLTAGE <= full_v <= high_v * OTHER_VOLTAGE
    span = f"{high_v:g}" if low_v == high_v else f"{low_v:g} to {high_v:g}"
    said = {
        "effects that are not rendered": "; ".join(
            f"{effect}, because {why}" for effect, why in inverse.not_rendered.items()
        ),
        "effects that are rendered within limits": "; ".join(
            f"{effect}: {limit}" for effect, limit in inverse.limits.items()
        ),
        "measured at another voltage": ""
        if fits
        else f"{span} V peak to peak, and full drive is {full_v:g} V on this screen; friction "
        "goes with its square, so that the gain may be off: calibrate on this rig",
    }
    return ". ".join(f"{heading}: {text}" for heading, text in said.items() if text)
