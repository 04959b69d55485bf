"""What the figures and tables of a laboratory microscope share."""

CERAMIC: dict[str, str | float] = {
    "piezo.kind": "ceramic",
    "piezo.hysteresis_x": 0.12,
    "piezo.hysteresis_y": 0.12,
    "piezo.stroke_x": 90e-6,
    "piezo.stroke_y": 90e-6,
    "piezo.creep": 0.02,
}
"""A piezo without correction: `piezo.*`."""
