"""A verb of your own: microscope.do("lift:LiftLine", lift=20e-9), or the action `verb` over topics."""

import numpy as np
from pydantic import Field

from afm_model.microscope import Arrays, Scan, Task, Verb, variable
from afm_model.microscope.plan import lines
from afm_model.microscope.quantities import Length, Rate
from afm_model.microscope.verb import outside
from afm_model.program.orders import FOLLOW, PROFILE, RAMP, Order, Step

SIGNALS = ["asked_x", "z", "deflection"]
SPEED = 10e-6  # from place to place [m/s]


class LiftLine(Verb):
    """Trace and retrace along x through where the scanner stands, and once more at a height above the sample."""

    returns = Arrays
    on_sample = slides = True

    size: Length = Field(100e-9, description="length of the line")
    lift: Length = Field(50e-9, description="height of the second pass above the line measured in the first")
    line_rate: Rate = Field(5.0, description="lines a second; a line is trace and retrace")

    def plan(self, view):
        frame = {"size_x": self.size, "line_rate": self.line_rate, "slow_axis": False}
        return lines(Scan(centre_x=view.place[0], centre_y=view.place[1], pixels=2, lines=1, **frame), view)

    def refusals(self, view, state):
        yield from outside(view, "with its turns the line goes too far: ", self.plan(view).corners)
        if self.lift > (left := view.z - view.z_range[0]):
            yield f"lift = {self.lift:g} m is not allowed here: z has {left:.4g} m left"

    def tasks(self, run):
        view, plan = run.view, self.plan(run.view)
        time, passes = plan.motion.samples * view.sample_period, [run.recorder(SIGNALS) for _ in range(2)]
        run.result, run.total = lambda: measured(passes), 4.0 * time
        yield from run.going(*plan.begin, SPEED)
        yield Task(Order(plan.motion), time, "measuring the line", passes[0])
        yield from run.going(*plan.begin, SPEED)
        run.state.approached = False  # z is moved now, not regulated
        first = passes[0].record().channels
        # Where the tip was, less the lift. Offsets of z count from where z stands when the loop is opened.
        above = first["z"] - first["deflection"] - self.lift - view.z
        up = Step(RAMP, target=above[0], rate=SPEED)
        yield Task(Order(view.stay(), (up,)), time, "lifting")
        fly = Step(PROFILE, profile=above, period=view.sample_period)
        yield Task(Order(plan.motion, (fly,)), time, "above the line", passes[1])
        yield from run.going(*plan.begin, SPEED)
        down = (Step(RAMP, target=0.0, rate=SPEED, then=1), Step(FOLLOW, duration=2e-3))
        yield Task(Order(view.stay(), down), time, "back to the sample")
        run.state.approached = True


def measured(passes):
    records = [each.record() for each in passes]
    count, units = min(len(each.time) for each in records), records[0].units
    both = {name: np.stack([each.channels[name][:count] for each in records]) for name in SIGNALS}
    return Arrays({name: variable(("pass", "sample"), both[name], name, units[name]) for name in SIGNALS})
