"""A microscope that runs somewhere else, on topics: what is asked of it here is done there."""

import math
import os
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatus
from afm_msgs.msg import ScanLine
from afm_msgs.srv import Exchange, ReadSignals, SetFeedback, SetGains, SetSetpoint
from std_srvs.srv import Trigger
from unique_identifier_msgs.msg import UUID

from afm_model.core.errors import ParameterError, VerbError
from afm_model.core.schema import Value
from afm_model.microscope.backend import Backend, OnLine, OnProgress
from afm_model.microscope.collect import Reading
from afm_model.microscope.interrupts import Interrupted, Interrupts
from afm_model.microscope.results import CANCELLED, COMPLETE, FAILED, MicroscopeState, Outcome, Progress
from afm_model.microscope.verb import Verb
from afm_model.microscope.verbs import Scan, Withdraw
from afm_model.microscope.view import CALIBRATIONS
from afm_node_common import topics
from afm_node_common.verb_codec import action_of, goal_of, lines_done, outcome_of, parameters

from .arriving import Arriving
from .remote_node import PATIENCE, SETTLED, RemoteNode

_LATE = 5.0
"""Wall time without a new line after which the lines that are missing are lost, and without news of a verb that was
broken off here after which its end is not waited for: the run is paused, or the microscope hangs [s]."""


class Remote(Backend):
    """The verbs of a microscope whose simulator runs in another process. Use as a context manager, or `close` it.

    It is the backend of `afm_model.microscope.Microscope` as `Local` is: the same verbs bring back the same bytes.
    Whoever calls it needs to serve no callbacks. Only `stop`, `pause` and `resume` may be called from another thread.

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
        self, namespace: str = topics.NAMESPACE, *, patience: float = PATIENCE, check: Callable[[], object] = tuple
    ) -> None:
        self._remote = RemoteNode(namespace, patience, check)
        self._lines: Arriving | None = None
        # By this subscription the microscope knows the client of each goal; see `topics.client`.
        self._identity = os.urandom(8)
        self._remote.node.create_subscription(UUID, topics.client(self._identity), lambda goal: None, 10)
        self._doing = self._stopped = self._stay = self._wanted_pause = self._paused = False
        self._remote.node.create_subscription(ScanLine, topics.SCAN_LINE, self._on_line, topics.SCAN_LINE_QOS)

    def _on_line(self, message: ScanLine) -> None:
        if self._lines is not None:
            self._lines.put(message)

    @property
    def state(self) -> MicroscopeState:
        """See `Backend`: as the microscope reported it last."""
        self._remote.spin_until(lambda: True, 0.0)
        told = self._remote.status
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
        name, action, remote = type(verb).__name__, action_of(verb), self._remote
        client = remote.action(action)
        there, news = remote.presence(client.server_is_ready), remote.news
        self._lines = lines = Arriving(verb, remote.time) if isinstance(verb, Scan) else None
        told = list[Any]()

        def call_back() -> None:
            """Outside of the callbacks of ROS: here anything may be asked of the microscope."""
            while on_progress is not None and told:
                said = told.pop(0).feedback
                on_progress(Progress(said.progress, said.detail))
            for line in lines.news() if lines is not None else ():
                if on_line is not None:
                    on_line(line)

        self._doing, self._stopped = True, False
        try:
            with Interrupts() as interrupts:
                number = UUID(uuid=list(self._identity + os.urandom(8)))
                sent = client.send_goal_async(goal_of(verb), feedback_callback=told.append, goal_uuid=number)
                remote.wait(sent.done, name, there)
                goal = sent.result()
                if not goal.accepted:
                    raise VerbError(f"{name} was refused without a sentence: another program serves {action}")
                ended = goal.get_result_async()
                cancelled_at = math.inf

                def over() -> bool:
                    nonlocal cancelled_at
                    call_back()
                    if (interrupts.there or self._stopped) and cancelled_at == math.inf:
                        cancelled_at = time.monotonic()
                        self._wanted_pause = False
                        if self._stays(interrupts):
                            # Refused where the verb has just come to its end.
                            with suppress(ParameterError):
                                remote.ask(Trigger, topics.STOP_VERB)
                        else:
                            goal.cancel_goal_async()
                    self._follow_pause()
                    if ended.done():
                        return True
                    if interrupts.times > 1 and time.monotonic() > cancelled_at + SETTLED:
                        raise KeyboardInterrupt
                    return False

                try:
                    remote.wait(over, name, there)
                except BaseException:
                    self._wanted_pause = False
                    self._follow_pause()
                    remote.abandon(goal, lambda: ended.done() or interrupts.times > 1, _LATE)
                    answer = ended.result() if ended.done() else None
                    unanswered = CANCELLED if there() else FAILED
                    self.outcome = self._outcome(verb, answer, unanswered, wait=False)
                    raise
                self.outcome = outcome = self._outcome(verb, ended.result())
                if outcome.status == FAILED and self._stopped and self._stays(interrupts):
                    # An action cannot say that somebody else has stopped it.
                    self.outcome = outcome = replace(outcome, status=CANCELLED)
                call_back()
                if outcome.status in (COMPLETE, CANCELLED):
                    remote.settle(news)
        finally:
            self._doing, self._lines, self._wanted_pause = False, None, False
        if interrupts.there:
            raise Interrupted(outcome)
        return outcome

    def _outcome(self, verb: Verb, answer: Any, unanswered: str = FAILED, *, wait: bool = True) -> Outcome:
        """How a verb has ended, by the answer to its goal (or `unanswered`) and the lines that have arrived."""
        lines = self._lines
        image = lines.image if lines is not None else None
        if answer is None:
            return Outcome(unanswered, f"{type(verb).__name__} was broken off before the microscope answered", image)
        result, missing, done = answer.result, 0, 0
        if lines is not None:
            before, done = -1, lines_done(result)
            while wait and lines.missing(done) and lines.received > before:
                before = lines.received
                self._remote.spin_until(partial(lines.has_news, done, before), _LATE)
            image, missing = lines.image, lines.missing(done)
        outcome = outcome_of(verb, result, cancelled=answer.status == GoalStatus.STATUS_CANCELED, image=image)
        if image is not None:
            image.lines_done = done
            image.complete = not missing and done == image.scan.lines
        if not missing:
            return outcome
        lost = (
            f"{missing} of {2 * done} lines of the scan (trace and retrace counted each) have not arrived "
            f"here and are NaN"
        )
        # One that was broken off did not wait for its last lines: it has still been cancelled.
        status = FAILED if wait else outcome.status
        return Outcome(status, "; ".join(filter(None, (outcome.message, lost))), image)

    def _stays(self, interrupts: Interrupts) -> bool:
        return self._stay and not interrupts.there

    def stop(self, *, stay: bool = False) -> None:
        """See `Backend`."""
        self._stay = stay
        self._stopped = True

    def read_signals(self, *names: str) -> dict[str, Reading]:
        """See `Backend`; not from another thread, as all but `stop`, `pause` and `resume`."""
        answer = self._remote.ask(ReadSignals, topics.READ_SIGNALS, names=names)
        return {name: Reading(*each) for name, *each in zip(answer.read, answer.values, answer.units, strict=True)}

    def pause(self) -> None:
        """See `Backend`. The run of the simulator is paused, for everybody."""
        if not self._doing:
            raise VerbError("nothing is being done: there is nothing to pause")
        self._wanted_pause = True

    def _follow_pause(self) -> None:
        if self._wanted_pause != self._paused:
            self._paused = self._wanted_pause
            self._remote.call(Trigger, topics.PAUSE if self._paused else topics.PLAY)

    def resume(self) -> None:
        """See `Backend`."""
        if self._wanted_pause:
            self._wanted_pause = False
            return
        try:
            self._remote.call(Trigger, topics.RESUME)
        except ParameterError as error:
            raise VerbError(str(error)) from None

    def set_loop(self, **settings: Any) -> None:
        """See `Backend`."""
        call = self._remote.call
        kinds = ("force", "voltage", "amplitude", "share")
        given = {name: settings.pop(f"setpoint_{name}") or 0.0 for name in kinds if f"setpoint_{name}" in settings}
        if given:
            call(SetSetpoint, topics.SET_SETPOINT, **given)
        gains = {name: settings.pop(f"{name}_gain", None) for name in ("proportional", "integral")}
        for name, value in gains.items():
            # The service takes negative ones for none given.
            if value is not None and not value >= 0.0:
                raise ParameterError(f"{name} = {value:g} is not allowed: it must be >= 0")
        if any(value is not None for value in gains.values()):
            call(SetGains, topics.SET_GAINS, **{k: -1.0 if v is None else v for k, v in gains.items()})
        if "feedback" in settings:
            call(SetFeedback, topics.SET_FEEDBACK, mode=settings.pop("feedback"))
        if calibrations := {name: settings.pop(name) for name in CALIBRATIONS if name in settings}:
            self.exchange("calibration", calibrations)
        limits: dict[str, Value] = {name: settings.pop(name) for name in ("low", "high") if name in settings}
        if limits:
            self.exchange("onboard", limits)
        if settings:
            raise ParameterError(f"{', '.join(settings)} cannot be set over topics")

    def exchange(self, group: str, changes: Mapping[str, Value]) -> None:
        """See `Backend`."""
        services = {"sample": topics.SET_SAMPLE, "plant": topics.SET_PROBE, "calibration": topics.SET_CALIBRATION}
        services["onboard"] = topics.SET_Z_LIMITS
        self._remote.call(Exchange, services[group], parameters=parameters(changes))

    def close(self) -> None:
        """Withdraw the tip and let go of the microscope, which goes on running."""
        if not self._remote.open:
            return
        outcome = self.outcome
        try:
            if self.state.approached:
                # Without a microscope there is no tip to withdraw.
                with suppress(VerbError):
                    self.execute(Withdraw())
        finally:
            self.outcome = outcome
            self._remote.destroy()
