"""Verbs of the microscope as actions."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from afm_model.errors import ParameterError, VerbError
from afm_model.microscope.results import COMPLETE, Outcome
from afm_model.microscope.verbs import Verb, Withdraw
from afm_model.run import Run
from afm_node_common.verbs import TOPICS, put_outcome, type_of, verb_of

from .clients import Feedback

_RESULT_KEPT = 30
"""Wall time for which a result is kept for a client that asks for it [s]: a night of force curves is some gigabytes."""


@dataclass
class Going:
    """A verb that is being done."""

    name: str
    verb: Verb
    goal: ServerGoalHandle | None
    over: Future


class Verbs:
    """Serves an action for each verb; one verb is done at a time.

    A goal that cannot be is accepted and aborted at once: a goal that is rejected would bring no sentence to its
    client.

    Parameters
    ----------
    node : Node
    run : Run
        With an attendant; `verb_over` is to be called at the end of each verb.
    begun : callable
        begun(verb): a verb is about to begin.
    changed : callable
        changed(): a verb has begun or ended.
    """

    def __init__(
        self, node: Node, run: Run, begun: Callable[[Verb], object], changed: Callable[[], object]
    ) -> None:
        self._node, self._run, self._begun, self._changed = node, run, begun, changed
        self._log = node.get_logger()
        self._feedback: dict[str, Feedback] = {}
        self._going: Going | None = None
        self.last = ""
        """What became of the verb before, in a sentence."""
        # Goals are answered late: what the node has otherwise must not wait for them.
        group = ReentrantCallbackGroup()
        self._servers = [
            ActionServer(
                node,
                type_of(name),
                topic,
                partial(self._execute, name),
                callback_group=group,
                cancel_callback=self._cancel,
                result_timeout=_RESULT_KEPT,
            )
            for name, topic in TOPICS.items()
        ]

    def close(self) -> None:
        """Let the node be destroyed."""
        for server in self._servers:
            server.destroy()

    @property
    def doing(self) -> str:
        """Name of the verb that is being done; empty: none."""
        return self._going.name if self._going is not None else ""

    def look(self) -> None:
        """Tell the client how far its verb is, and see whether it is still there; a few times a second."""
        going = self._going
        if going is None or going.goal is None:
            return
        feedback, progress = self._feedback[going.name], self._run.attendant.progress
        # First: what is published now has not been acknowledged yet.
        if feedback.gone:
            self._log.warning(f"the client of {going.name} has gone: it is cancelled and the tip withdrawn")
            self._run.attendant.cancel("cancelled, because its client has gone")
        told = type_of(going.name).Feedback(progress=float(progress.fraction), detail=progress.detail)
        feedback.publish(going.goal, told)

    def verb_over(self, outcome: Outcome) -> None:
        """A verb has come to its end."""
        going, self._going = self._going, None
        if going is not None:
            self.last = outcome.message or f"{going.name} was done"
            going.over.set_result(outcome)
        self._changed()

    def _cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        going = self._going
        if going is not None and going.goal is not None and going.goal.goal_id == goal.goal_id:
            self._run.attendant.cancel("cancelled")
        # Another one has not begun, or is over: `_execute` sees that it was cancelled.
        return CancelResponse.ACCEPT

    async def _execute(self, name: str, goal: ServerGoalHandle) -> Any:
        result = type_of(name).Result()
        try:
            verb = verb_of(name, goal.request)
            if goal.is_cancel_requested:
                return await self._cancelled_before(name, goal, result)
            over = self._begin(name, verb, goal)
        except (ParameterError, VerbError) as error:
            self._log.warning(f"{name} was refused: {error}")
            result.message = str(error)
            goal.abort()
            return result
        outcome = await over
        put_outcome(outcome, result)
        if goal.is_cancel_requested:
            # One that came with the last line: cancelled is cancelled, the tip is withdrawn.
            if outcome.status == COMPLETE:
                result.success, result.message = False, f"{name} was cancelled at its end; the tip is withdrawn"
                await self._withdraw()
            goal.canceled()
        elif outcome.status == COMPLETE:
            goal.succeed()
        else:
            self._log.warning(outcome.message)
            goal.abort()
        return result

    def _begin(self, name: str, verb: Verb, goal: ServerGoalHandle | None) -> Future:
        if objection := self._run.attendant.objection(verb):
            raise VerbError(objection)
        self._begun(verb)
        if goal is not None:
            if name not in self._feedback:
                self._feedback[name] = Feedback(self._node, type_of(name), TOPICS[name])
            self._feedback[name].begin()
        self._going = Going(name, verb, goal, Future())
        over = self._going.over
        try:
            self._run.begin(verb)
        except VerbError:
            self._going = None
            raise
        self._changed()
        return over

    async def _cancelled_before(self, name: str, goal: ServerGoalHandle, result: Any) -> Any:
        await self._withdraw()
        result.message = f"{name} was cancelled before it began"
        goal.canceled()
        return result

    async def _withdraw(self) -> None:
        """What a cancelled goal leaves; not while another one is being done."""
        attendant = self._run.attendant
        if attendant.busy or not attendant.state.near:
            return
        try:
            over = self._begin("Withdraw", Withdraw(), None)
        except VerbError as error:
            self._log.warning(f"the tip was not withdrawn: {error}")
            return
        await over
