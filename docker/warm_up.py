"""Fill the caches of an image by using everything once: byte code, compiled kernels, the font list of matplotlib."""

import importlib

from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build, simulate

NODES = ("afm_sim_node", "afm_controller_node", "afm_recorder_node")

for module in ("afm_bringup.session", "matplotlib.font_manager", *(f"{package}.node" for package in NODES)):
    importlib.import_module(module)
# The loop holds every part of ours: one run compiles it. The law of a node stands apart.
simulate(build(SimParameters, {"run.duration": 1e-3}), ControllerParameters())
Controller(ControllerParameters()).answer(Instrument(SimParameters(), 1).measurement)
