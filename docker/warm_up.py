"""Fill the caches of an image by using everything once: byte code, compiled kernels, the font list of matplotlib."""

import importlib

from afm_model import ControllerParameters, SimParameters, build, simulate

NODES = ("afm_sim_node", "afm_controller_node", "afm_recorder_node")

for module in ("afm_bringup.session", "matplotlib.font_manager", *(f"{package}.node" for package in NODES)):
    importlib.import_module(module)
# The kernels hold every plant and every law: one run compiles them all.
simulate(build(SimParameters, {"run.duration": 1e-3}), ControllerParameters())
