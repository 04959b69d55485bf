"""The order of the numbers that travel between instrument and controller, SI units.

A measurement is one float64 array in this order, which is also the order of the fields of afm_msgs/Measurement after
its sequence number; a drive is an array of three voltages (x, y, z).
"""

DEFLECTION = 0
"""Cantilever deflection z_c - a [m], as read from the photodetector."""
DEFLECTION_RATE = 1
"""Its rate [m/s]."""
LATERAL_FORCE = 2
"""Force of the sample on the tip along x [N], as read from the photodetector."""
DEFLECTION_VOLTAGE = 3
"""Photodetector signal of the deflection [V]."""
LATERAL_VOLTAGE = 4
"""Photodetector signal of the lateral force [V]."""
POSITION = 5
"""Scanner position x, y, z [m]."""
VELOCITY = 8
"""Scanner velocity x, y, z [m/s]."""
REFERENCE_POSITION = 11
"""Reference to track: scanner x, y; tip height z [m]."""
REFERENCE_VELOCITY = 14
"""Its velocity [m/s]."""
REFERENCE_ACCELERATION = 17
"""Its acceleration [m/s^2]."""
DRIVE = 20
"""Drive applied until this instant [V]."""
MEASUREMENT_SIZE = 23

# Channels of the virtual ADC.
CHANNEL_DEFLECTION, CHANNEL_LATERAL, CHANNEL_LATERAL_Y, CHANNEL_NORMAL = range(4)
CHANNELS = 4
