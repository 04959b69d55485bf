"""The service `preview_reference`: what measurements to come will contain of the reference."""

import array

import numpy as np
from afm_msgs.srv import PreviewReference
from numpy.typing import NDArray
from rclpy.node import Node

from afm_model import InstrumentParameters, ParameterError, PartError
from afm_model.instrument.preview import Previewer

from . import topics

MOST = PreviewReference.Request.MOST


class PreviewServer:
    """Offers the service on a node that stands for the instrument.

    Parameters
    ----------
    node : Node
    parameters : InstrumentParameters
    """

    def __init__(self, node: Node, parameters: InstrumentParameters) -> None:
        self._period = parameters.plant.control_period
        self._previewer: Previewer | None = None
        self._problem = ""
        try:
            self._previewer = Previewer(parameters)
            # What is to be compiled or loaded is so before a run goes by the clock.
            self._previewer.ask(0, 1)
        except (ParameterError, PartError) as error:
            self._problem = str(error)
        node.create_service(PreviewReference, topics.PREVIEW_REFERENCE, self._answer)

    def _answer(
        self, request: PreviewReference.Request, response: PreviewReference.Response
    ) -> PreviewReference.Response:
        if self._previewer is None:
            response.message = self._problem
            return response
        if request.count > MOST:
            response.message = (
                f"count = {request.count} is not allowed: it must be from 1 to {MOST}; ask again for more"
            )
            return response
        try:
            found = self._previewer.ask(request.first, request.count)
        except (ParameterError, PartError) as error:
            response.message = str(error)
            return response
        response.success, response.period = True, self._period
        for name in ("position", "velocity", "acceleration"):
            setattr(response, name, _numbers(getattr(found, name)))
        return response


def _numbers(values: NDArray[np.float64]) -> "array.array[float]":
    """As a message takes them without looking at each."""
    return array.array("d", values.tobytes())
