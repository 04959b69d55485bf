"""Fill the caches of an image by using everything once: byte code, compiled kernels, the font list of matplotlib.

`core`: an image without recorder and pictures.
"""

import importlib
import sys

from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build, simulate

MODULES = ["afm_sim_node.node", "afm_controller_node.node"]
if sys.argv[1:] != ["core"]:
    MODULES += ["afm_recorder_node.node", "afm_bringup.session", "matplotlib.font_manager"]

for module in MODULES:
    importlib.import_module(module)
# The loop holds every part of ours: one run compiles it. The law of a node stands apart.
simulate(build(SimParameters, {"run.duration": 1e-3}), ControllerParameters())
Controller(ControllerParameters()).answer(Instrument(SimParameters(), 1).measurement)
