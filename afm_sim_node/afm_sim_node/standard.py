"""The verbs of simulation_interfaces, served with the standard types where that package is installed.

Without it nothing is served, and nothing fails. https://github.com/ros-simulation/simulation_interfaces
"""

from importlib.util import find_spec
from typing import Any

from rclpy.node import Node
from rclpy.task import Future

from afm_model.run import OVER, Run, RunState
from afm_node_common.answers import AnsweringServer

from .run_services import Control

INSTALLED = find_spec("simulation_interfaces") is not None
"""Whether the package with the types is installed."""


class Standard:
    """Offers the services of the standard for the control of a run. There are no entities and no worlds to load.

    Parameters
    ----------
    node : Node
    run : Run
    control : Control

    Raises
    ------
    ImportError
        Where simulation_interfaces is not installed.

    Call `look` now and then, for feedback.
    """

    def __init__(self, node: Node, run: Run, control: Control) -> None:
        from rclpy.action import CancelResponse
        from simulation_interfaces import action, msg, srv

        self._run, self._control = run, control
        self._result, self._state, self._set = msg.Result, msg.SimulationState, srv.SetSimulationState.Response
        self._reset_scope, self._action = srv.ResetSimulation.Request, action.SimulateSteps
        features = msg.SimulatorFeatures
        self._features = features(
            features=[
                features.SIMULATION_RESET,
                features.SIMULATION_STATE_GETTING,
                features.SIMULATION_STATE_SETTING,
                features.SIMULATION_STATE_PAUSE,
                features.STEP_SIMULATION_SINGLE,
                features.STEP_SIMULATION_MULTIPLE,
                features.STEP_SIMULATION_ACTION,
            ],
            custom_info="virtual AFM: a step is one control tick",
        )
        self._looks: list[Future] = []
        node.create_service(srv.GetSimulatorFeatures, "get_simulator_features", self._serve_features)
        node.create_service(srv.GetSimulationState, "get_simulation_state", self._serve_state)
        node.create_service(srv.SetSimulationState, "set_simulation_state", self._serve_set)
        node.create_service(srv.ResetSimulation, "reset_simulation", self._serve_reset)
        node.create_service(srv.StepSimulation, "step_simulation", self._serve_step, callback_group=control.patient)
        self._actions = AnsweringServer(
            node,
            action.SimulateSteps,
            "simulate_steps",
            self._simulate_steps,
            callback_group=control.patient,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
        )

    def look(self) -> None:
        """Let feedback go out where steps are being made."""
        looks, self._looks = self._looks, []
        for future in looks:
            future.set_result(None)

    def close(self) -> None:
        """Let the node be destroyed."""
        self._actions.destroy()

    @property
    def _now(self) -> int:
        """The state by the standard: a run that waits for a controller is playing, one that is over is stopped."""
        run = self._run
        if run.state == RunState.PAUSED:
            return int(self._state.STATE_PAUSED)
        if run.state in OVER or (run.state == RunState.WAITING and run.held):
            return int(self._state.STATE_STOPPED)
        return int(self._state.STATE_PLAYING)

    def _answer(self, problem: str, code: int | None = None) -> Any:
        """A result: success, or the reason of the failure."""
        failed = self._result.RESULT_OPERATION_FAILED if code is None else code
        return self._result(result=failed if problem else self._result.RESULT_OK, error_message=problem)

    def _serve_features(self, request: Any, response: Any) -> Any:
        response.features = self._features
        return response

    def _serve_state(self, request: Any, response: Any) -> Any:
        response.state.state = self._now
        response.result = self._answer("")
        return response

    def _serve_set(self, request: Any, response: Any) -> Any:
        wanted, now, state = request.state.state, self._now, self._state
        if wanted == now:
            response.result = self._answer("the run is in this state already", self._set.ALREADY_IN_TARGET_STATE)
        elif wanted == state.STATE_PLAYING:
            if self._run.state in OVER:
                self._control.reset()
            response.result = self._answer(self._run.play(), self._set.STATE_TRANSITION_ERROR)
        elif wanted == state.STATE_PAUSED and now == state.STATE_PLAYING:
            response.result = self._answer(self._run.pause(), self._set.STATE_TRANSITION_ERROR)
        elif wanted == state.STATE_PAUSED:
            error = "a run that is stopped cannot be paused: it has not begun"
            response.result = self._answer(error, self._set.INCORRECT_TRANSITION)
        elif wanted == state.STATE_STOPPED:
            self._control.reset()
            response.result = self._answer(self._run.pause())
        else:
            error = f"state {wanted} is not allowed: 0 (stopped), 1 (playing) or 2 (paused)"
            response.result = self._answer(error, self._result.RESULT_FEATURE_UNSUPPORTED)
        return response

    def _serve_reset(self, request: Any, response: Any) -> Any:
        scope = self._reset_scope
        both = scope.SCOPE_TIME | scope.SCOPE_STATE
        if request.scope != scope.SCOPE_DEFAULT and request.scope & both != both:
            error = f"scope {request.scope} is not allowed: time and state are reset together (0, 3 or 255)"
            response.result = self._answer(error, self._result.RESULT_FEATURE_UNSUPPORTED)
        else:
            self._control.reset()
            response.result = self._answer("")
        return response

    async def _serve_step(self, request: Any, response: Any) -> Any:
        response.result = self._answer(await self._control.step(request.steps))
        return response

    async def _simulate_steps(self, goal: Any) -> Any:
        """Make the steps of a goal; a goal that is cancelled pauses the run."""
        steps = goal.request.steps
        problem = self._run.step_by(steps)
        end = self._run.instrument.ticks + steps
        while not problem and self._run.stepping:
            done = steps - self._run.steps_left
            goal.publish_feedback(self._action.Feedback(completed_steps=done, remaining_steps=self._run.steps_left))
            if goal.is_cancel_requested:
                self._run.pause()
            future = Future()
            self._looks.append(future)
            await future
        problem = problem or self._control.missing(end)
        if goal.is_cancel_requested:
            goal.canceled()
        elif problem:
            goal.abort()
        else:
            goal.succeed()
        return self._action.Result(result=self._answer(problem))
