"""The paper's control laws, docs/theory.md (28), from a measurement in SI to a piezo drive in volts."""

import math

import numpy as np
from numpy.typing import NDArray

from .. import signals
from ..errors import ParameterError
from ..jit import kernel
from ..parameters import ControllerParameters
from .lyapunov import lyapunov_matrix

OPEN_LOOP, SGN, TANH = range(3)
_KINDS = {"open_loop": OPEN_LOOP, "sgn": SGN, "tanh": TANH}
_Vector = NDArray[np.float64]

_AXIS = ("c", "cdot", "p2", "p4", "M", "alpha", "eta", "xi", "volts")
FIELDS = (
    "kind",
    "tip_rate",
    *(f"{name}_{axis}" for axis in "xyz" for name in _AXIS),
    "eta_c",
    "mu",
    "a",
    "x0",
    "z0",
    "w0",
)
RECORD = np.dtype((np.record, [(name, np.float64) for name in FIELDS]))
"""See `afm_model.plant.constants.RECORD`."""


def law_constants(parameters: ControllerParameters) -> _Vector:
    """Constants of a law for `control`, in the order of `FIELDS`; made anew whenever a parameter changes.

    Returns
    -------
    ndarray (len(FIELDS),)
        Nondimensional gains; `volts_x` is the drive voltage per unit of U_x.
    """
    law, scanner, scales = parameters.law, parameters.scanner, parameters.scales
    record = np.zeros(1, RECORD)
    record["kind"] = _KINDS[law.kind]
    record["tip_rate"] = law.z_rate == "tip"
    for axis, length in (("x", scales.x0), ("y", scales.x0), ("z", scales.z0)):
        c, cdot = getattr(law, f"c_{axis}"), getattr(law, f"cdot_{axis}")
        P = lyapunov_matrix(c, cdot)
        eta = 2.0 * math.pi * getattr(scanner, f"f_{axis}") / scales.w0
        values = {
            "c": c,
            "cdot": cdot,
            "p2": P[0, 1],
            "p4": P[1, 1],
            "M": getattr(law, f"M_{axis}"),
            "alpha": law.alpha_z if axis == "z" else law.alpha,
            "eta": eta,
            "xi": getattr(scanner, f"xi_{axis}"),
            # Static displacement is U / eta^2 in units of length.
            "volts": length / (eta**2 * getattr(parameters.piezo, f"sensitivity_{axis}")),
        }
        for name, value in values.items():
            record[f"{name}_{axis}"] = value
    record["eta_c"] = 2.0 * math.pi * parameters.cantilever.f_c / scales.w0
    record["mu"] = scanner.mu
    record["a"] = parameters.cantilever.a / scales.z0
    record["x0"], record["z0"], record["w0"] = scales.x0, scales.z0, scales.w0
    return record.view(np.float64)


@kernel
def switching(kind: float, s: float, alpha: float) -> float:
    """sgn(s), or tanh(alpha s) in its place."""
    if kind == TANH:
        return math.tanh(alpha * s)
    if s > 0.0:
        return 1.0
    return -1.0 if s < 0.0 else 0.0


@kernel
def control(constants: _Vector, y: _Vector, u: _Vector) -> None:
    """Write into `u` the drive [V] that answers measurement `y`.

    open_loop: U_x = x_r, U_y = y_r as in section 4.1 of the paper; the z drive stays as it is.
    sgn, tanh: docs/theory.md (28), (31), with v = -M sgn(s) or -M tanh(alpha s), s = p_2 e + p_4 e'.

    Parameters
    ----------
    constants : ndarray
        From `law_constants`.
    y : ndarray (MEASUREMENT_SIZE,)
        In the order of `afm_model.signals`.
    u : ndarray (3,) [V]
        Written.
    """
    g = constants.view(RECORD)[0]
    x_r = y[signals.REFERENCE_POSITION] / g.x0
    y_r = y[signals.REFERENCE_POSITION + 1] / g.x0
    if g.kind == OPEN_LOOP:
        u[0] = g.volts_x * x_r
        u[1] = g.volts_y * y_r
        u[2] = y[signals.DRIVE + 2]
        return

    speed = g.x0 * g.w0
    acceleration = speed * g.w0

    # x
    x1 = y[signals.POSITION] / g.x0
    x2 = y[signals.VELOCITY] / speed
    e = x1 - x_r
    e_rate = x2 - y[signals.REFERENCE_VELOCITY] / speed
    v = -g.M_x * switching(g.kind, g.p2_x * e + g.p4_x * e_rate, g.alpha_x)
    feedforward = y[signals.REFERENCE_ACCELERATION] / acceleration
    u[0] = g.volts_x * (
        -g.c_x * e - g.cdot_x * e_rate + feedforward + g.eta_x * g.eta_x * x1 + 2.0 * g.xi_x * g.eta_x * x2 + v
    )

    # y
    x3 = y[signals.POSITION + 1] / g.x0
    x4 = y[signals.VELOCITY + 1] / speed
    e = x3 - y_r
    e_rate = x4 - y[signals.REFERENCE_VELOCITY + 1] / speed
    v = -g.M_y * switching(g.kind, g.p2_y * e + g.p4_y * e_rate, g.alpha_y)
    feedforward = y[signals.REFERENCE_ACCELERATION + 1] / acceleration
    u[1] = g.volts_y * (
        -g.c_y * e - g.cdot_y * e_rate + feedforward + g.eta_y * g.eta_y * x3 + 2.0 * g.xi_y * g.eta_y * x4 + v
    )

    # z: the tip height z_c = a + deflection is driven to the setpoint
    x5 = g.a + y[signals.DEFLECTION] / g.z0
    rate = y[signals.DEFLECTION_RATE] if g.tip_rate else y[signals.VELOCITY + 2]
    x6 = rate / (g.z0 * g.w0)
    e = x5 - y[signals.REFERENCE_POSITION + 2] / g.z0
    v = -g.M_z * switching(g.kind, g.p2_z * e + g.p4_z * x6, g.alpha_z)
    u[2] = g.volts_z * (
        (g.eta_z * g.eta_z + g.eta_c * g.eta_c / g.mu) * x5
        + 2.0 * g.xi_z * g.eta_z * x6
        + (1.0 + 1.0 / g.mu) * (-g.c_z * e - g.cdot_z * x6 + v)
    )


class Controller:
    """A law with its parameters, ready to answer measurements.

    Parameters
    ----------
    parameters : ControllerParameters

    Attributes
    ----------
    constants : ndarray
        What the kernel `control` takes; another array after the parameters have changed.

    Raises
    ------
    ParameterError
        If parameters are so large or small that the law cannot be computed, here or when they are assigned.
    """

    constants: _Vector

    def __init__(self, parameters: ControllerParameters) -> None:
        self._drive = np.zeros(3)
        self.parameters = parameters

    @property
    def parameters(self) -> ControllerParameters:
        """The parameters in force; assigning changes the law from the next measurement on."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: ControllerParameters) -> None:
        try:
            self.constants = law_constants(parameters)
        except (ArithmeticError, ValueError) as error:
            raise ParameterError(f"some parameter of the law is too large or too small ({error})") from None
        self._parameters = parameters

    def answer(self, measurement: _Vector) -> _Vector:
        """Drive [V], (3,), for a measurement in the order of `afm_model.signals`; valid until the next call."""
        control(self.constants, measurement, self._drive)
        return self._drive
