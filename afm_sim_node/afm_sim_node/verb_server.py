"""Verbs of the microscope as actions."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.action import CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from afm_model.core.errors import VerbError
from afm_model.microscope.results import CANCELLED, Outcome
from afm_model.microscope.verb import Verb
from afm_model.microscope.verbs import Withdraw
from afm_model.run import Run
from afm_node_common.answers import AnsweringServer
from afm_node_common.barrier import sentence
from afm_node_common.verb_codec import ACTIONS, TITLES, put_outcome, verb_of

from .clients import Clients, process_of

_RESULT_KEPT = 30
"""Wall time for which a result is kept for a client that asks for it [s]: a night of force curves is some gigabytes."""

_LAST_WORDS = 0.3
"""Wall time that a node which ends leaves for the answer to its last goal [s]."""


class PatientServer(AnsweringServer):
    """An action server whose goals are executed by somebody else, and answered when that is over.

    A coroutine in its place would be resumed again and again by the executor, which looks at every entity of the node
    each time: half a millisecond of the loop.

    Parameters
    ----------
    begin : callable
        begin(goal): a goal is accepted; `answer` is called when it is over.
    """

    def __init__(
        self, node: Node, kind: Any, name: str, begin: Callable[[ServerGoalHandle], None], **options: Any
    ) -> None:
        super().__init__(node, kind, name, self._never, **options)
        self._begin = begin

    def _never(self, goal: ServerGoalHandle) -> Any:
        raise AssertionError("a goal is answered by `answer`")

    def notify_execute(self, goal_handle: ServerGoalHandle, execute_callback: object) -> None:
        """Called by rclpy when a goal is accepted."""
        self._begin(goal_handle)

    async def execute(self, taken_data: Any) -> None:
        """Called by rclpy with requests that have come; whatever they lead to, the node goes on."""
        try:
            await super().execute(taken_data)
        except GeneratorExit:  # the node ends
            raise
        except BaseException as error:
            self._node.get_logger().warning(f"a request to an action was not answered: {sentence(error)}")

    async def _execute_goal(self, execute_callback: Any, goal_handle: ServerGoalHandle) -> None:
        """Called by rclpy to answer a goal.

        It forgets a goal whose number has come a second time just when the first was given up, 30 s after its end.
        """
        try:
            await super()._execute_goal(execute_callback, goal_handle)
        except KeyError:
            self._node.get_logger().warning("a goal was not answered: another one had the same number")

    def answer(self, goal: ServerGoalHandle, conclude: Callable[[ServerGoalHandle], Any]) -> None:
        """Send the client the result that `conclude` returns; `conclude` has to set the state of the goal, too."""
        super().notify_execute(goal, conclude)


@dataclass
class Going:
    """A verb that is being done."""

    title: str
    action: str
    goal: ServerGoalHandle | None  # None: nobody has asked for it
    over: Callable[[Outcome], None]
    cancelled: bool = False  # by its client


class VerbServer:
    """Serves an action for each verb, and one for all others; one verb is done at a time.

    A goal that cannot be is accepted and aborted at once: a goal that is rejected would bring no sentence to its
    client.

    Parameters
    ----------
    node : Node
    run : Run
        With an operator; `verb_over` is to be called at the end of each verb.
    begun : callable
        begun(verb): a verb is about to begin.
    changed : callable
        changed(event, warn): a verb has begun or ended, in a sentence; warn: not as asked.
    brought : callable
        brought(title, outcome): a verb has ended.
    """

    def __init__(
        self,
        node: Node,
        run: Run,
        begun: Callable[[Verb], object],
        changed: Callable[[str, bool], object],
        brought: Callable[[str, Outcome], object],
    ) -> None:
        self._run, self._begun, self._changed, self._brought = run, begun, changed, brought
        self._log = node.get_logger()
        self._clients = Clients(node)
        self._going: Going | None = None
        self._unanswered = 0
        self.scan = 0
        """Number of the scan that was begun last."""
        self.last = ""
        """What became of the verb before, in a sentence."""
        # Goals are answered late: what the node has otherwise must not wait for them.
        options: dict[str, Any] = {
            "callback_group": ReentrantCallbackGroup(),
            "cancel_callback": self._cancel,
            "result_timeout": _RESULT_KEPT,
        }
        self._servers = {
            name: PatientServer(node, kind, name, partial(self._accepted, name), **options)
            for name, kind in ACTIONS.items()
        }

    def close(self) -> None:
        """Let the node be destroyed."""
        for server in self._servers.values():
            server.destroy()

    def finish(self, spin_once: Callable[[float], None]) -> None:
        """Answer a goal that has just come to its end: the node ends, nobody else would."""
        if self._unanswered:
            # Its client asks for the result in a message of its own.
            limit = time.monotonic() + _LAST_WORDS
            while time.monotonic() < limit:
                spin_once(_LAST_WORDS / 10.0)

    def look(self) -> None:
        """Report to the client how far its verb is, and see whether it is still there; a few times a second."""
        going = self._going
        if going is None or going.goal is None:
            return
        progress, kind = self._run.operator.progress, ACTIONS[going.action]
        told = kind.Feedback(progress=float(progress.fraction), detail=progress.detail)
        if self._clients.look(kind, going.action, going.goal, told):
            self._log.warning(f"the client of {going.title} has gone: it is cancelled and the tip withdrawn")
            self._run.operator.cancel("cancelled, because its client has gone")

    def verb_over(self, outcome: Outcome) -> None:
        """A verb has come to its end."""
        going, self._going = self._going, None
        if going is not None:
            self.last = outcome.message or f"{going.title} was done"
            going.over(outcome)
            self._brought(going.title, outcome)
            # A result that is whole may have a remark, too.
            warn = bool(outcome.message) and not (going.cancelled and outcome.status == CANCELLED)
            if warn:
                self._log.warning(outcome.message)
            elif outcome.message:
                self._log.info(outcome.message)
            self._changed(self.last, warn)

    def _cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        going = self._going
        if going is not None and going.goal is not None and going.goal.goal_id == goal.goal_id:
            going.cancelled = True
            self._run.operator.cancel("cancelled")
        else:
            # It is over and has not been answered: cancelled is cancelled.
            self._withdraw()
        return CancelResponse.ACCEPT

    def _accepted(self, name: str, goal: ServerGoalHandle) -> None:
        result = ACTIONS[name].Result()
        try:
            verb = verb_of(name, goal.request)
            self._begin(name, verb, goal, partial(self._over, name, goal, result))
        # Neither numbers too large to compute with nor a verb of somebody else's are a reason to end.
        except BaseException as error:
            told = sentence(error)
            self._log.warning(f"{name} was refused: {told}")
            result.message = told
            self._answer(name, goal, result)

    def _begin(self, name: str, verb: Verb, goal: ServerGoalHandle | None, over: Callable[[Outcome], None]) -> None:
        if objection := self._run.operator.objection(verb):
            raise VerbError(objection)
        self._begun(verb)
        if goal is not None:
            process = process_of(self._servers[name].asking.get(bytes(goal.goal_id.uuid), b""))
            self._clients.begin(ACTIONS[name], name, goal, process)
        self._going = Going(type(verb).__name__, name, goal, over)
        try:
            self._run.begin(verb)
        except BaseException:
            self._going = None
            raise
        self._changed(f"{type(verb).__name__} has begun", False)

    def _over(self, name: str, goal: ServerGoalHandle, result: Any, outcome: Outcome) -> None:
        put_outcome(outcome, result)
        if hasattr(result, "scan"):
            result.scan = self.scan
        self._answer(name, goal, result)

    def _answer(self, name: str, goal: ServerGoalHandle, result: Any) -> None:
        """Send the result."""

        def conclude(goal: ServerGoalHandle) -> Any:
            self._unanswered -= 1
            if goal.is_cancel_requested:
                if result.success:
                    result.success, result.message = (
                        False,
                        f"{TITLES[name]} was cancelled at its end; the tip is withdrawn",
                    )
                goal.canceled()
            elif result.success:
                goal.succeed()
            else:
                goal.abort()
            return result

        self._unanswered += 1
        self._servers[name].answer(goal, conclude)

    def _withdraw(self) -> None:
        """Take the tip away; not while another verb is being done."""
        operator = self._run.operator
        if not operator.busy and operator.state.near:
            try:
                self._begin(Withdraw.name, Withdraw(), None, lambda outcome: None)
            except VerbError as error:
                self._log.warning(f"the tip was not withdrawn: {error}")
