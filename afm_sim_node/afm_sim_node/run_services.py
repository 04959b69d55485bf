"""Services by which a run is controlled."""

from collections.abc import Callable
from functools import partial

from afm_msgs.srv import Step
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from afm_model.run import Run
from afm_node_common import topics


class Control:
    """Serves `play`, `pause`, `reset`, `resume` and `step`.

    Parameters
    ----------
    node : Node
    run : Run
    """

    def __init__(self, node: Node, run: Run) -> None:
        self._run = run
        self._waiting: list[tuple[Future, int]] = []
        for name, ask in (
            (topics.PLAY, run.play),
            (topics.PAUSE, run.pause),
            (topics.RESUME, run.resume),
            (topics.RESET, self.reset),
        ):
            node.create_service(Trigger, name, partial(self._serve, ask))
        self.patient = ReentrantCallbackGroup()
        """Callback group of services that answer late, so that no other callback waits for them."""
        node.create_service(Step, topics.STEP, self._serve_step, callback_group=self.patient)

    async def step(self, ticks: int) -> str:
        """Make so many ticks; why they were not made, or an empty string, when that is known."""
        if problem := self._run.step_by(ticks):
            return problem
        future = Future()
        self._waiting.append((future, self._run.instrument.ticks + ticks))
        return str(await future)

    def state_changed(self) -> None:
        """Answer the calls of `step` that are complete or cannot be completed."""
        if self._run.stepping:
            return
        waiting, self._waiting = self._waiting, []
        for future, end in waiting:
            future.set_result(self.missing(end))

    def missing(self, end: int) -> str:
        """Why the steps were given up before the tick `end`; empty if they were not."""
        if self._run.instrument.ticks == end:
            return ""
        return f"not all of the ticks were made: the run is {self._run.state.title}"

    def _serve(self, ask: Callable[[], str], request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = ask()
        response.success = not response.message
        return response

    async def _serve_step(self, request: Step.Request, response: Step.Response) -> Step.Response:
        response.message = await self.step(request.ticks)
        response.success = not response.message
        return response

    def reset(self) -> str:
        """Back to the start."""
        self._run.reset()
        return ""
