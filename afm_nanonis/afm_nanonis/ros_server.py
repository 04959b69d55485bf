"""`ros2 run afm_nanonis server SCENARIO`: the ports of the protocol in front of a microscope on topics."""

import sys
from collections.abc import Sequence

from afm_bringup.remote import Remote
from afm_model import ParameterError, ScenarioError
from afm_model.core.errors import VerbError
from afm_model.microscope import Microscope, with_verbs
from afm_model.parameters.scenario import load_scenario
from afm_node_common import topics

from .command import options, serve
from .front import Front

_PATIENCE = 60.0
"""Wall time in which the microscope must be there: it may just be starting [s]."""


def main(given: Sequence[str] | None = None) -> int:
    """Entry point; the exit code is 2 if something was refused."""
    parser = options(
        "server", "The Nanonis TCP protocol in front of a microscope on topics; give the scenario that it runs."
    )
    parser.add_argument("--namespace", default=topics.NAMESPACE, help="of the instrument")
    arguments = parser.parse_args(given)
    try:
        arguments.out.mkdir(parents=True, exist_ok=True)
        scenario = load_scenario(arguments.scenario, parts=arguments.parts)
        # One connection is busy with a verb, while the other one sets and reads.
        with (
            Microscope(Remote(arguments.namespace, patience=_PATIENCE), engaged=arguments.engaged) as microscope,
            Microscope(Remote(arguments.namespace)) as asked,
        ):
            serve(Front(microscope, with_verbs(scenario.sim), arguments.out.absolute(), asked), arguments)
    except (ScenarioError, ParameterError, VerbError, OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0
