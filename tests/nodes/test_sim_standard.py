"""The verbs of simulation_interfaces: served where that package is installed; where it is not, nothing of it is there.

One of the two halves of this file is there to be run, by what is installed.
"""

from typing import Any

from hand_controller import HandController, answer
from support import Graph, Observer, ros_arguments

from afm_sim_node.node import SimNode
from afm_sim_node.standard import INSTALLED

TICKS = 40
PARAMETERS = {
    "plant.control_period": 1e-4,
    "detector.sample_period": 1e-4,
    "run.duration": TICKS * 1e-4,
    "run.start_paused": True,
}
NAMES = {
    "get_simulator_features",
    "get_simulation_state",
    "set_simulation_state",
    "reset_simulation",
    "step_simulation",
}


def served(simulator: SimNode) -> set[str]:
    return {str(service.srv_name).rpartition("/")[2] for service in simulator.services}


if not INSTALLED:

    def test_without_the_package_no_verb_of_it_is_served_and_the_simulator_runs() -> None:
        with Graph(ros_arguments(PARAMETERS | {"run.start_paused": False})) as graph:
            observer = graph.add(Observer())
            graph.add(HandController(lambda measurement: [answer(measurement, 0.0, 0.0)]))
            simulator = graph.add(SimNode())
            assert not NAMES & served(simulator)
            graph.spin_until(lambda: observer.scores)

else:
    from rclpy.action import ActionClient
    from simulation_interfaces.action import SimulateSteps
    from simulation_interfaces.msg import Result, SimulationState, SimulatorFeatures
    from simulation_interfaces.srv import (
        GetSimulationState,
        GetSimulatorFeatures,
        ResetSimulation,
        SetSimulationState,
        StepSimulation,
    )

    STOPPED, PLAYING, PAUSED = (
        SimulationState.STATE_STOPPED,
        SimulationState.STATE_PLAYING,
        SimulationState.STATE_PAUSED,
    )

    class Client:
        """Asks by the standard types."""

        def __init__(self, graph: Graph) -> None:
            self.graph = graph
            self.node = graph.add(Observer())
            self._clients: dict[str, Any] = {}

        def call(self, kind: Any, name: str, **request: Any) -> Any:
            client = self._clients.setdefault(name, self.node.create_client(kind, name))
            self.graph.spin_until(client.service_is_ready)
            return self.graph.result(client.call_async(kind.Request(**request)))

        @property
        def state(self) -> int:
            return int(self.call(GetSimulationState, "get_simulation_state").state.state)

        def set(self, state: int) -> Any:
            request = SimulationState(state=state)
            return self.call(SetSimulationState, "set_simulation_state", state=request).result

        def step(self, steps: int) -> Any:
            return self.call(StepSimulation, "step_simulation", steps=steps).result

    def test_every_verb_of_the_standard_does_what_it_says() -> None:
        with Graph(ros_arguments(PARAMETERS)) as graph:
            client = Client(graph)
            graph.add(HandController(lambda measurement: [answer(measurement, 0.0, 0.0)]))
            simulator = graph.add(SimNode())
            assert served(simulator) >= NAMES
            features = client.call(GetSimulatorFeatures, "get_simulator_features").features
            assert SimulatorFeatures.STEP_SIMULATION_ACTION in features.features
            assert client.state == STOPPED
            assert client.set(PAUSED).result == SetSimulationState.Response.INCORRECT_TRANSITION
            assert client.set(STOPPED).result == SetSimulationState.Response.ALREADY_IN_TARGET_STATE
            assert client.step(3).result == Result.RESULT_OK
            assert (client.state, simulator.run.instrument.ticks) == (PAUSED, 3)

            steps = ActionClient(client.node, SimulateSteps, "simulate_steps")
            graph.spin_until(steps.server_is_ready)
            goal = graph.result(steps.send_goal_async(SimulateSteps.Goal(steps=4)))
            done = graph.result(goal.get_result_async())
            assert (done.result.result.result, simulator.run.instrument.ticks) == (Result.RESULT_OK, 7)

            scope = ResetSimulation.Request
            told = client.call(ResetSimulation, "reset_simulation", scope=scope.SCOPE_TIME).result
            assert told.result == Result.RESULT_FEATURE_UNSUPPORTED
            told = client.call(ResetSimulation, "reset_simulation", scope=scope.SCOPE_ALL).result
            assert (told.result, simulator.run.instrument.ticks, client.state) == (Result.RESULT_OK, 0, STOPPED)
            assert client.set(PLAYING).result == Result.RESULT_OK
            graph.spin_until(lambda: client.state == STOPPED)
            assert simulator.run.state.name == "FINISHED"
            assert client.step(1).result == Result.RESULT_OPERATION_FAILED
            # A run that is over plays again from the start.
            assert client.set(PLAYING).result == Result.RESULT_OK
            graph.spin_until(lambda: len(client.node.scores) == 2)
            assert client.node.scores[0].trajectory_sha256 == client.node.scores[1].trajectory_sha256
