"""State of a plant: one float64 array, the same layout for both plants, so that every byte of it can be compared."""

# Positions and rates, nondimensional: X, Y in x0; Z (sample height), Q (tip apex height, z_c) in z0; rates in w0.
X, V_X, Y, V_Y, Z, V_Z, Q, V_Q = range(8)
CONTACT = 8
"""1.0 in contact, 0.0 out of it."""
N = 9
"""Normal force of the last step [m_c w0^2 z0]."""
F_X, F_Y = 10, 11
"""Friction of the sample on the tip in the last step, minus that on the scanner [m_p w0^2 x0]."""
F_MAX = 12
"""Largest friction possible in the last step, the radius of the friction disc [m_p w0^2 x0]."""
SIZE = 13
