"""What verbs bring back, on a topic: for a recorder, or whoever else has not asked for the verb."""

from typing import Any

from afm_msgs.msg import NamedArray
from rclpy.node import Node

from afm_model.microscope.arrays import Arrays, Variable, arrays_of
from afm_model.microscope.image import Image
from afm_model.microscope.results import Outcome
from afm_node_common import topics
from afm_node_common.verb_codec import named_arrays

_MOST = 100_000
"""Numbers of an array at most: of a longer one, one in several is published."""


class Results:
    """Publishes results as afm_msgs/NamedArray, a message for each array.

    Each says to which result it belongs, in its attributes: `result.verb`, `result.number`, `result.arrays` (how many),
    `result.time_ns` (simulated), `result.status`; `about.NAME` are the attributes of the result as a whole. Images are
    not published here: their lines have been.

    Parameters
    ----------
    node : Node
    """

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(NamedArray, topics.RESULTS, topics.RESULTS_QOS)
        self._number = 0

    def publish(self, run_id: int, verb: str, outcome: Outcome, stamp_ns: int) -> None:
        """Publish what a verb has brought back, if that is arrays and somebody listens.

        Parameters
        ----------
        run_id : int
        verb : str
            Its type, as ForceCurve.
        outcome : Outcome
        stamp_ns : int
            Simulated time at its end [ns].
        """
        self._number += 1
        if isinstance(outcome.result, Image) or not self._publisher.get_subscription_count():
            return
        arrays = arrays_of(outcome.result)
        if arrays is None:
            return
        about: dict[str, Any] = {
            "verb": verb,
            "number": self._number,
            "arrays": len(arrays.variables) + len(arrays.coordinates),
            "time_ns": stamp_ns,
            "status": outcome.status,
        }
        told = {f"about.{name}": value for name, value in arrays.attributes.items()}
        told |= {f"result.{name}": value for name, value in about.items()}
        for message in named_arrays(_shorter(arrays, told)):
            message.run_id = run_id
            self._publisher.publish(message)


def _shorter(arrays: Arrays, told: dict[str, Any]) -> Arrays:
    """Return arrays with at most `_MOST` numbers along their longest dimension and attributes of the whole result."""
    every = [*arrays.variables.values(), *arrays.coordinates.values()]
    lengths = {dim: length for each in every for dim, length in zip(each.dims, each.values.shape, strict=True)}
    longest = max(lengths, key=lambda dim: lengths[dim], default="")
    step = -(-max((each.values.size for each in every), default=0) // _MOST) or 1

    def kept(each: Variable) -> Variable:
        part = tuple(slice(None, None, step) if dim == longest else slice(None) for dim in each.dims)
        return Variable(each.dims, each.values[part], {**each.attributes, **told})

    variables, coordinates = (
        {name: kept(each) for name, each in group.items()} for group in (arrays.variables, arrays.coordinates)
    )
    return Arrays(variables, coordinates)
