"""A microscope that runs somewhere else, on topics: what is asked of it here is done there."""

import math
import os
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from types import TracebackType
from typing import Any

from action_msgs.msg import GoalStatus
from afm_msgs.msg import MicroscopeStatus, ScanLine
from afm_msgs.srv import Exchange, SetFeedback, SetGains, SetSetpoint
from rclpy import init
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger
from unique_identifier_msgs.msg import UUID

from afm_model.core.errors import ParameterError, VerbError
from afm_model.core.schema import Value
from afm_model.microscope.backend import Backend, OnLine, OnProgress
from afm_model.microscope.image import Image
from afm_model.microscope.interrupts import Interrupted, Interrupts
from afm_model.microscope.results import COMPLETE, FAILED, MicroscopeState, Outcome, Progress
from afm_model.microscope.verb import Verb
from afm_model.microscope.verbs import Scan, Withdraw
from afm_node_common import topics
from afm_node_common.shared_memory import shared_memory_cleanup
from afm_node_common.verb_codec import ACTIONS, action_of, goal_of, outcome_of

from .arriving import Arriving

PATIENCE = 10.0
"""Wall time in which a microscope is found, and in which it answers a setting [s]."""
_GONE = 5.0
"""Wall time without its action server after which a microscope has ended [s]."""
_LATE = 5.0
"""Wall time without a new line after which the lines that are missing are lost [s]."""
_SETTLED = 1.0
"""Wall time in which it says how it stands after a verb or a setting [s]."""


def _nothing() -> None:
    """Nothing to be checked."""


class Remote(Backend):
    """The verbs of a microscope whose simulator runs in another process. Use as a context manager, or `close` it.

    It is the backend of `afm_model.microscope.Microscope` as `Local` is: the same verbs bring back the same bytes.
    Whoever calls it needs to serve no callbacks.

    Parameters
    ----------
    namespace : str
        Of the instrument.
    patience : float
        Wall time in which it must be found [s].
    check : callable, optional
        Called some times a second while anything is waited for. What it raises ends the wait.

    Raises
    ------
    VerbError
        If there is no microscope.
    """

    def __init__(
        self,
        namespace: str = topics.NAMESPACE,
        *,
        patience: float = PATIENCE,
        check: Callable[[], object] = _nothing,
    ) -> None:
        self.outcome: Outcome | None = None
        """How the last verb has ended, also one that Ctrl-C has cancelled."""
        self._check = check
        self._cancel = False
        self._context = Context()
        # Ctrl-C is Python's: it cancels the verb, and the tip is withdrawn before this process ends.
        init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(f"microscope_client_{os.getpid()}", namespace=namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._actions: dict[str, ActionClient] = {}
        self._services: dict[str, Any] = {}
        self._told: MicroscopeStatus | None = None
        self._news = 0
        self._lines: Arriving | None = None
        self._node.create_subscription(MicroscopeStatus, topics.MICROSCOPE, self._on_told, topics.LATCHED_QOS)
        # By this subscription the microscope knows the client of each goal; see `topics.client`.
        self._identity = os.urandom(8)
        self._node.create_subscription(UUID, topics.client(self._identity), lambda goal: None, 10)
        self._node.create_subscription(ScanLine, topics.SCAN_LINE, self._on_line, topics.SCAN_LINE_QOS)
        try:
            found = self._spin_until(lambda: self._told is not None, patience)
        except BaseException:
            self._destroy()
            raise
        if not found:
            self._destroy()
            domain = os.environ.get("ROS_DOMAIN_ID") or 0
            raise VerbError(
                f"there is no microscope on /{namespace.strip('/')} in ROS domain {domain}: "
                "start a simulator with reference.kind = verbs, or give its namespace and ROS_DOMAIN_ID"
            )

    def __enter__(self) -> "Remote":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # What Backend asks for.

    @property
    def state(self) -> MicroscopeState:
        """See `Backend`: as it was told last."""
        self._spin_until(lambda: True, 0.0)
        told = self._told
        assert told is not None
        return MicroscopeState(
            approached=told.approached,
            feedback=told.feedback,
            setpoint=told.setpoint_voltage,
            proportional_gain=told.proportional_gain,
            integral_gain=told.integral_gain,
            place=(told.x, told.y),
            near=told.approached or bool(told.doing),
            doing=told.doing,
        )

    def objection(self, verb: Verb) -> str:
        """See `Backend`. Only the microscope itself knows: it refuses the verb when it comes."""
        return ""

    def execute(self, verb: Verb, on_progress: OnProgress | None = None, on_line: OnLine | None = None) -> Outcome:
        """See `Backend`. Ctrl-C cancels the verb, as does what `check`, `on_progress` or `on_line` raises.

        Raises
        ------
        Interrupted
            After Ctrl-C: the tip is withdrawn; it has what was measured.
        KeyboardInterrupt
            After another Ctrl-C, if the verb has not come to its end meanwhile: a run that is paused cancels nothing.
        VerbError
            If the microscope does not answer, or has ended.
        """
        name = type(verb).__name__
        action = action_of(verb)
        client = self._action(action)
        self._lines = Arriving(verb, self._time, on_line) if isinstance(verb, Scan) else None
        news, self._cancel, self.outcome = self._news, False, None
        there = partial(self._serves, client.server_is_ready, self._publishers())

        def on_feedback(message: Any) -> None:
            if on_progress is not None:
                on_progress(Progress(message.feedback.progress, message.feedback.detail))

        with Interrupts() as interrupts:
            number = UUID(uuid=list(self._identity + os.urandom(8)))
            sent = client.send_goal_async(goal_of(verb), feedback_callback=on_feedback, goal_uuid=number)
            self._wait(sent.done, name, there)
            goal = sent.result()
            if not goal.accepted:
                raise VerbError(f"{name} was refused without a sentence: another program serves {action}")
            ended = goal.get_result_async()
            cancelled_at = math.inf

            def over() -> bool:
                nonlocal cancelled_at
                if (interrupts.there or self._cancel) and cancelled_at == math.inf:
                    cancelled_at = time.monotonic()
                    goal.cancel_goal_async()
                if ended.done():
                    return True
                if interrupts.times > 1 and time.monotonic() > cancelled_at + _SETTLED:
                    raise KeyboardInterrupt
                return False

            try:
                self._wait(over, name, there)
            except BaseException:
                on_progress = self._lines = None
                self._abandon(goal, ended)
                raise
            answer = ended.result()
            cancelled = answer.status == GoalStatus.STATUS_CANCELED
            image, missing = self._image(answer.result)
            outcome = outcome_of(verb, answer.result, cancelled=cancelled, image=image)
            if missing:
                lost = (
                    f"{missing} of {2 * answer.result.lines_done} lines of the scan (trace and retrace counted each) "
                    f"have not arrived here and are NaN"
                )
                outcome = Outcome(FAILED, "; ".join(filter(None, (outcome.message, lost))), image)
            self.outcome, self._lines = outcome, None
            if outcome.status == COMPLETE or cancelled:
                self._spin_until(
                    lambda: self._news > news and self._told is not None and not self._told.doing, _SETTLED
                )
        if interrupts.there:
            raise Interrupted(outcome)
        return outcome

    def cancel(self) -> None:
        """Cancel what is being done, as Ctrl-C does; for `check`, and for what is called with progress and lines."""
        self._cancel = True

    def set_loop(self, **settings: Any) -> None:
        """See `Backend`. Limits of z cannot be set over topics."""
        given = [settings.pop(name, None) for name in ("setpoint_force", "setpoint_voltage")]
        if given != [None, None]:
            self._call(SetSetpoint, topics.SET_SETPOINT, force=given[0] or 0.0, voltage=given[1] or 0.0)
        gains = {name: settings.pop(f"{name}_gain", None) for name in ("proportional", "integral")}
        for name, value in gains.items():
            # The service takes negative ones for none given.
            if value is not None and not value >= 0.0:
                raise ParameterError(f"{name} = {value:g} is not allowed: it must be >= 0")
        if any(value is not None for value in gains.values()):
            self._call(SetGains, topics.SET_GAINS, **{k: -1.0 if v is None else v for k, v in gains.items()})
        if "feedback" in settings:
            self._call(SetFeedback, topics.SET_FEEDBACK, mode=settings.pop("feedback"))
        if settings:
            raise ParameterError(f"{', '.join(settings)} cannot be set over topics")

    def resume(self) -> None:
        """See `Backend`."""
        try:
            self._call(Trigger, topics.RESUME)
        except ParameterError as error:
            raise VerbError(str(error)) from None

    def exchange(self, group: str, changes: Mapping[str, Value]) -> None:
        """See `Backend`."""
        topic = {"sample": topics.SET_SAMPLE, "plant": topics.SET_PROBE}[group]
        self._call(Exchange, topic, names=list(changes), values=[_text(value) for value in changes.values()])

    def close(self) -> None:
        """Withdraw the tip and let go of the microscope, which goes on running."""
        if not self._context.ok():
            return
        try:
            if self.state.approached:
                # Without a microscope there is no tip to withdraw.
                with suppress(VerbError):
                    self.execute(Withdraw())
        finally:
            self._destroy()

    # How it is done.

    @property
    def _time(self) -> float:
        """Simulated time last heard of [s]."""
        assert self._told is not None
        stamp = self._told.header.stamp
        return float(stamp.sec + stamp.nanosec * 1e-9)

    def _on_told(self, message: MicroscopeStatus) -> None:
        self._told = message
        self._news += 1

    def _on_line(self, message: ScanLine) -> None:
        if self._lines is not None:
            self._lines.put(message)

    def _spin_until(self, predicate: Callable[[], bool], timeout: float) -> bool:
        limit = time.monotonic() + timeout
        while True:
            self._executor.spin_once(timeout_sec=min(max(limit - time.monotonic(), 0.0), 0.05))
            self._check()
            if predicate():
                return True
            if time.monotonic() >= limit:
                return False

    def _publishers(self) -> set[bytes]:
        """Which microscopes there are: one that was started anew is another one."""
        infos = self._node.get_publishers_info_by_topic(self._node.resolve_topic_name(topics.MICROSCOPE))
        return {bytes(info.endpoint_gid) for info in infos}

    def _serves(self, ready: Callable[[], bool], microscopes: set[bytes]) -> bool:
        """Whether one of these microscopes is there, and ready."""
        return ready() and not (microscopes and microscopes.isdisjoint(self._publishers()))

    def _abandon(self, goal: Any, ended: Any) -> None:
        """Cancel a verb for which nobody waits any more, and give it a moment to withdraw the tip."""
        goal.cancel_goal_async()
        # What has brought the verb to this end counts, not what comes of it.
        with suppress(Exception):
            self._spin_until(ended.done, _SETTLED)

    def _wait(self, predicate: Callable[[], bool], name: str, there: Callable[[], bool]) -> None:
        """Serve callbacks until `predicate` holds; raise if the microscope is no longer there."""
        seen = time.monotonic()
        while not self._spin_until(predicate, 0.2):
            now = time.monotonic()
            if there():
                seen = now
            elif now > seen + _GONE:
                raise VerbError(f"the microscope has ended while {name} was being done")

    def _action(self, name: str) -> ActionClient:
        if name not in self._actions:
            self._actions[name] = ActionClient(self._node, ACTIONS[name], name)
        if not self._spin_until(self._actions[name].server_is_ready, PATIENCE):
            raise VerbError(f"the microscope does not serve {name} (waited {PATIENCE:g} s)")
        return self._actions[name]

    def _call(self, kind: Any, topic: str, **values: Any) -> None:
        if topic not in self._services:
            self._services[topic] = self._node.create_client(kind, topic)
        client, news = self._services[topic], self._news
        if not self._spin_until(client.service_is_ready, PATIENCE):
            raise VerbError(f"the microscope does not serve {topic} (waited {PATIENCE:g} s)")
        there = partial(self._serves, client.service_is_ready, self._publishers())
        answered = client.call_async(kind.Request(**values))
        # Another sample or probe: what is compiled for it may take a while.
        while not self._spin_until(answered.done, PATIENCE):
            if not there():
                raise VerbError(f"the microscope has ended without an answer to {topic}")
        if not answered.result().success:
            raise ParameterError(answered.result().message)
        self._spin_until(lambda: self._news > news, _SETTLED)

    def _image(self, result: Any) -> tuple[Image | None, int]:
        """What the lines came to, and how many of them are missing."""
        lines = self._lines
        if lines is None:
            return None, 0
        before = -1

        def news(before: int) -> bool:
            return not lines.missing(result.lines_done) or lines.received > before

        while lines.missing(result.lines_done) and lines.received > before:
            before = lines.received
            self._spin_until(partial(news, before), _LATE)
        missing = lines.missing(result.lines_done)
        image = lines.image
        if image is not None:
            image.lines_done = result.lines_done
            image.complete = not missing and result.lines_done == image.scan.lines
        return image, missing

    def _destroy(self) -> None:
        with shared_memory_cleanup():
            self._executor.shutdown()
            for client in self._actions.values():
                client.destroy()
            self._node.destroy_node()
            self._context.try_shutdown()


def _text(value: Value) -> str:
    """As a parameter file has it."""
    return str(value).lower() if isinstance(value, bool) else str(value)
