"""Ridges along y with flat tops and slopes: step grating, or wedge for lateral calibration. Edges are rounded.

The profile is the path of the apex of a spherical tip that rolls over it: flats stay, slopes move out by
R tan(angle/2), an outer edge of radius r is followed with r + R, an inner one with r - R.
The curvature is that of the edges, docs/lever.md (8).
"""

import math
from typing import Annotated

from annotated_types import Gt, Le
from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Block, Record
from ..core.elementary import cos, square, tan
from ..core.schema import Positive, Unit
from ..parts.groups import SampleParameters
from ..parts.part import Numbers, Sample, Tree
from ..parts.signals import Surface


class Grating(SampleParameters):
    """Ridges along y, x = 0 in the middle between two."""

    kind: str = Field("grating", description="the sample")
    pitch: Annotated[Positive, Unit("m")] = Field(3e-6, description="period along x")
    step: Annotated[Positive, Unit("m")] = Field(20e-9, description="height of the ridges")
    angle: Annotated[float, Gt(0), Le(1.4), Unit("rad")] = Field(
        1.0, description="angle of the slopes; 0.9553 (54.74 degrees) for etched silicon"
    )
    top: Annotated[Positive, Unit("m")] = Field(1.5e-6, description="width of a top between its edges, unrounded")
    edge_radius: Annotated[Positive, Unit("m")] = Field(20e-9, description="radius of the rounded edges")


class Constants(Record):
    pitch: Annotated[float, "m"]
    foot: float  # where the slope begins, behind the inner arc; [m] from the middle, as all places here
    foot_flat: float  # where the inner arc begins
    head: float  # where the outer arc begins
    head_flat: float  # where it ends
    slope: float
    step: Annotated[float, "m"]
    inner: Annotated[float, "m"]  # radii of the arcs
    outer: Annotated[float, "m"]
    bend: Annotated[float, "1/m"]  # mean curvature of the edges
    x0: Annotated[float, "m"]
    z0: Annotated[float, "m"]


def _values(parameters: Tree) -> Numbers:
    sample = parameters.sample
    R = parameters.plant.radius_of_tip(parameters)
    inner, outer = sample.edge_radius - R, sample.edge_radius + R
    half = tan(0.5 * sample.angle)
    corner = 0.5 * (sample.pitch - sample.top) - R * half
    foot = corner - sample.step / tan(sample.angle)
    return {
        "foot": foot + inner * half * cos(sample.angle),
        "foot_flat": foot - inner * half,
        "head": corner - outer * half * cos(sample.angle),
        "head_flat": corner + outer * half,
        "slope": tan(sample.angle),
        "inner": inner,
        "outer": outer,
        "bend": 0.5 / sample.edge_radius,
    }


def _check(parameters: Tree) -> None:
    sample, R = parameters.sample, parameters.plant.radius_of_tip(parameters)
    if sample.edge_radius <= R:
        x = 0.5 * (sample.pitch - sample.top) - sample.step / tan(sample.angle)
        raise ValueError(
            f"sample.edge_radius = {sample.edge_radius:g} m is not allowed: in the inner edges, at x = +-{x:.4g} m, a "
            f"tip of radius {R:g} m touches at two places. Use sample.edge_radius > {R:g} m, a sharper tip "
            f"(plant.tip_radius < {sample.edge_radius:g} m), or the ridges as a height map (sample.kind = map), which "
            f"any tip dilates"
        )
    v = _values(parameters)
    if not 0.0 <= v["foot_flat"] <= v["foot"] <= v["head"] <= v["head_flat"] <= 0.5 * sample.pitch:
        raise ValueError(
            f"sample.pitch = {sample.pitch:g} m, sample.top = {sample.top:g} m, sample.step = {sample.step:g} m, "
            f"sample.angle = {sample.angle:g} rad, sample.edge_radius = {sample.edge_radius:g} m are not allowed "
            f"together: flats, slopes and rounded edges must fit into half a pitch, and both edges into a slope"
        )


@kernel
def surface(x: float, y: float, h: Surface, p: Constants, unused: Block) -> None:
    """See `afm_model.parts.Sample`."""
    at = x * p.x0 + 0.5 * p.pitch
    at -= p.pitch * math.floor(at / p.pitch) + 0.5 * p.pitch
    side = 1.0 if at >= 0.0 else -1.0
    r = abs(at)
    height = slope = second = bend = 0.0
    if r >= p.head_flat:
        height = p.step
    elif r >= p.head:
        below = p.head_flat - r
        rest = math.sqrt(p.outer * p.outer - below * below)
        height, slope = p.step - p.outer + rest, below / rest
        second, bend = -p.outer * p.outer / (rest * rest * rest), p.bend
    elif r > p.foot:
        # From the outer arc's end down the slope.
        below = p.head_flat - p.head
        height = p.step - p.outer + math.sqrt(p.outer * p.outer - below * below) - p.slope * (p.head - r)
        slope = p.slope
    elif r > p.foot_flat:
        beyond = r - p.foot_flat
        rest = math.sqrt(p.inner * p.inner - beyond * beyond)
        height, slope = p.inner - rest, beyond / rest
        second, bend = p.inner * p.inner / (rest * rest * rest), -p.bend
    scale = p.x0 * p.x0 / p.z0
    h.height = height / p.z0
    h.slope_x, h.slope_y = side * slope * p.x0 / p.z0, 0.0
    h.curvature = bend * scale
    h.curvature_xx, h.curvature_yy, h.curvature_xy = second * scale, 0.0, 0.0
    h.strength = 1.0


def _curvature(parameters: Tree) -> float:
    return 0.5 / float(parameters.sample.edge_radius) * square(parameters.scales.x0) / float(parameters.scales.z0)


GRATING = Sample(
    name="grating",
    parameters=Grating,
    constants=Constants,
    values=_values,
    check=_check,
    height=lambda parameters: 0.5 * parameters.sample.step,
    curvature=_curvature,
    surface=surface,
)
