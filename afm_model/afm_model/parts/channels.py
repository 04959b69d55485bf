"""The one table of the channels of an instrument: what is sampled at the rate of the virtual ADC.

Topics, recorder and reader take names and units from here. Parts add further channels
(`afm_model.parts.Channel`).
"""

from .part import Channel

DEFLECTION = Channel(
    "deflection", "m", "detection.deflection_voltage", lambda parameters: parameters.detector.deflection_sensitivity
)
LATERAL_FORCE = Channel(
    "lateral_force", "N", "detection.lateral_voltage", lambda parameters: parameters.detector.lateral_sensitivity
)
LATERAL_FORCE_Y = Channel("truth/lateral_force_y", "N", "truth.friction.y")
NORMAL_FORCE = Channel("truth/normal_force", "N", "truth.normal_force")
STANDARD = (DEFLECTION, LATERAL_FORCE, LATERAL_FORCE_Y, NORMAL_FORCE)
"""Sampled in every run."""

OPTIONAL = (
    *(Channel(f"truth/position_{axis}", "m", f"truth.position.{axis}") for axis in "xyz"),
    *(Channel(f"truth/velocity_{axis}", "m/s", f"truth.velocity.{axis}") for axis in "xyz"),
    Channel("truth/tip_height", "m", "truth.tip_height"),
    Channel("truth/tip_rate", "m/s", "truth.tip_rate"),
    Channel("truth/lateral_force_x", "N", "truth.friction.x"),
    Channel("truth/friction_bound", "N", "truth.friction_bound"),
    Channel("truth/contact", "1", "truth.contact"),
    Channel("truth/stuck", "1", "truth.stuck"),
    *(Channel(f"drive_{axis}", "V", f"applied.voltage.{axis}") for axis in "xyz"),
    *(Channel(f"truth/piezo_{axis}", "V", f"effective.voltage.{axis}") for axis in "xyz"),
    *(Channel(f"truth/drift_{axis}", "m", f"drifted.displacement.{axis}") for axis in "xyz"),
)
"""Sampled besides if detector.channels names them, whatever the parts are."""
