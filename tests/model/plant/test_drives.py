"""Claims about drives of the tip, and of the base sideways and rocking, against closed forms and an integration."""

import cmath
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp, trapezoid

from afm_model import ParameterError, build
from afm_model.parameters import InstrumentParameters

from ..clamped_mode import clamped_mode
from ..held import held
from .test_lever import exact_contact, series

F0, F_TORSION, Q, DRIVE, AHEAD = 26e3, 200e3, 30.0, 1e-11, 0.3
LEVER = {
    "plant.kind": "lever",
    "plant.f0": F0,
    "plant.f_torsion": F_TORSION,
    "plant.scanner": "stack_13um",
    "sample.kind": "flat",
    "onboard.kind": "dynamic",
    "onboard.feedback": "external",
    "detector.channels": "amplitude, phase, in_phase, quadrature",
}
FREE = {"plant.gap": 1e-6, "plant.hamaker": 1e-21, "plant.Q": Q}
TWISTING = {"onboard.drive": "torsion", "onboard.lock_in": "lateral", "plant.torsion": "moving", "plant.modes": 1}


def beam(number: int) -> tuple[float, float, float]:
    """Of a clamped beam's mode: frequency over that of the first, static deflection of the end under a force there over
    that of the beam, slope of the end times length.
    """
    mode = clamped_mode(number)
    # Stiffness of a mode of deflection 1 at the end: E I / L^3 = k / 3 times x^4 times its mean square.
    give = 3.0 * mode.end**2 / (mode.wave_number**4 * mode.mean_square)
    return mode.over_first, give, mode.slope / mode.end


def pushed(f: float) -> tuple[complex, complex]:
    """Deflection of the end, and its slope times the length, under a force on the tip, over force by spring constant:
    three modes that move, and of all others what is static.
    """
    end, turn = 1.0 + 0.0j, 1.5 + 0.0j
    for number in range(3):
        over_first, give, slope = beam(number)
        r = f / (F0 * over_first)
        more = give / (1.0 - r * r + 1j * r / Q) - give
        end, turn = end + more, turn + slope * more
    return end, turn


def rocked(f: float) -> complex:
    """Twist that the photodiode shows over that of a base that rocks: with it, and in the bar's first mode."""
    over_mean_square = quad(lambda s: math.sin(0.5 * math.pi * s), 0.0, 1.0)[0] / 0.5
    r = f / F_TORSION
    return 1.0 + over_mean_square * r * r / (1.0 - r * r + 1j * r / Q)


def settled(resonance: float, f: float, **values: Any) -> tuple[dict[str, np.ndarray], float]:
    """Channels of a free cantilever, from the start on, and the time between two samples [s]."""
    dt, decay = 1.0 / (320 * resonance), Q / (math.pi * resonance)
    given: dict[str, Any] = {
        "plant.dt": dt,
        "detector.sample_period": 20 * dt,
        "plant.control_period": 400 * dt,
        "onboard.time_constant": 0.5 * decay,
        "onboard.drive_phase": AHEAD,
        "onboard.drive_frequency": f,
        "onboard.drive_amplitude": DRIVE,
    }
    parameters = build(InstrumentParameters, LEVER | FREE | given | values)
    return held(parameters, math.ceil(26.0 * decay / (400 * dt)))[1], 20 * dt


def shown(resonance: float, f: float, **values: Any) -> tuple[complex, float, float]:
    """In-phase part less i times quadrature [m], amplitude [m] and phase [rad] that the lock-in has settled to."""
    read, _ = settled(resonance, f, **values)
    last = {name: float(each[-20:].mean()) for name, each in read.items()}
    return complex(last["in_phase"], -last["quadrature"]), last["amplitude"], last["phase"]


AROUND = (0.96, 1.0 - 0.5 / Q, 1.0, 1.0 + 0.5 / Q, 1.04)


@pytest.mark.parametrize("mode", [0, 1, 2])
@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_resonance_curve_of_a_driven_tip_is_the_closed_form_within_1e_4_for_each_mode(mode, tilt):
    resonance = F0 * beam(mode)[0]
    for r in AROUND:
        values = {"plant.modes": 3, "plant.tilt": tilt, "onboard.drive": "tip"}
        found, amplitude, phase = shown(resonance, r * resonance, **values)
        closed = DRIVE * 2.0 / 3.0 * pushed(r * resonance)[1] * cmath.exp(1j * AHEAD)
        assert found / closed == pytest.approx(1.0, abs=1e-4)
        assert amplitude / abs(closed) == pytest.approx(1.0, abs=1e-4)
        assert cmath.exp(-1j * phase) == pytest.approx(closed / abs(closed), abs=1e-4)


def test_resonance_curve_of_torsion_by_a_base_that_rocks_is_the_closed_form_within_1e_4():
    for r in AROUND:
        values = TWISTING | {"plant.Q_torsion": Q, "plant.Q": 100.0}
        found, amplitude, phase = shown(F_TORSION, r * F_TORSION, **values)
        closed = DRIVE * rocked(r * F_TORSION) * cmath.exp(1j * AHEAD)
        assert found / closed == pytest.approx(1.0, abs=1e-4)
        assert amplitude / abs(closed) == pytest.approx(1.0, abs=1e-4)
        assert cmath.exp(-1j * phase) == pytest.approx(closed / abs(closed), abs=1e-4)


def test_drive_of_torsion_is_at_its_resonance_unless_told_otherwise_and_needs_one():
    parameters = {"plant.dt": 1.5e-8, "detector.sample_period": 3e-7, "plant.control_period": 6e-6}
    given = LEVER | FREE | parameters | {"onboard.drive_amplitude": DRIVE, "plant.Q_torsion": 10.0}
    given |= {"onboard.time_constant": 2e-5}
    _, read, _ = held(build(InstrumentParameters, given | TWISTING), 100)
    assert read["amplitude"][-1] / DRIVE == pytest.approx(abs(1.0 - 40.0j / math.pi), rel=0.01)
    with pytest.raises(ParameterError, match=r"not allowed with plant.torsion = static, which has no resonance"):
        build(InstrumentParameters, given | TWISTING | {"plant.torsion": "static"})


@pytest.mark.parametrize("r", [0.5, 0.96, 1.0])
def test_tip_that_is_driven_moves_as_the_end_does_and_turns_with_it(r):
    tilt = 0.2
    values = {"plant.modes": 3, "plant.tilt": tilt, "onboard.drive": "tip", "detector.channels": "truth/tip_height"}
    read, period = settled(F0, r * F0, **values)
    height = read["truth/tip_height"]
    last = np.arange(height.size - 64, height.size)
    columns = [np.cos(2.0 * math.pi * r * F0 * last * period), np.sin(2.0 * math.pi * r * F0 * last * period)]
    of_cos, of_sin, _ = np.linalg.lstsq(np.column_stack([*columns, np.ones(64)]), height[last], rcond=None)[0]
    end, turn = pushed(r * F0)
    c = build(InstrumentParameters, LEVER | FREE).plant.cantilever_numbers
    arm = (c.tip_height + 0.5 * c.thickness) / c.length
    closed = DRIVE * (math.cos(tilt) * end - math.sin(tilt) * arm * turn) * cmath.exp(1j * AHEAD)
    assert complex(of_cos, -of_sin) / closed == pytest.approx(1.0, abs=2e-4)


CONTACT = {"plant.tilt": 0.0, "reference.z_r": 50e-9}


def stuck_spring(parameters: Any, torsion: float) -> tuple[float, float, float]:
    """Of a tip that sticks under the load of reference.z_r: its lateral spring without this share of the torsion, that
    of the whole torsion [N/m], and the friction bound [N].
    """
    plant = parameters.plant
    c, pair, units = plant.cantilever_numbers, plant.pair_numbers, plant.contact_units
    a, force, _ = exact_contact(plant.contact, plant.transition)
    radius = float(np.interp(c.k * 50e-9 / units.force, force, a)) * units.radius
    k_tip = c.k_torsion / (c.tip_height + 0.5 * c.thickness) ** 2
    rest = series(k_tip / (1.0 - torsion), c.k_in_plane, 8.0 * pair.G * radius)
    return rest, k_tip, pair.tau * math.pi * radius**2


def test_base_that_moves_sideways_shows_the_spring_of_a_stuck_tip_and_nothing_off_the_sample():
    values = LEVER | CONTACT | {"onboard.drive": "lateral", "onboard.lock_in": "lateral", "plant.dt": 2e-7}
    values |= {"onboard.drive_frequency": 2e3, "onboard.drive_amplitude": 2e-11, "onboard.time_constant": 5e-4}
    parameters = build(InstrumentParameters, values)
    _, read, _ = held(parameters, 800)
    spring, k_tip, bound = stuck_spring(parameters, 0.0)
    assert spring * 2e-11 < 0.5 * bound
    # The sample pulls the tip back: it twists the other way.
    found = complex(read["in_phase"][-1], -read["quadrature"][-1])
    assert found / (-2e-11 * spring / k_tip) == pytest.approx(1.0, abs=2e-3)
    _, read, _ = held(build(InstrumentParameters, values | {"plant.gap": 1e-6}), 100)
    assert not read["amplitude"].any()


def over_friction(r: float, drive: float, Q: float, g: float, periods: int) -> tuple[complex, complex]:
    """Torsion by a base that rocks, over a surface with dry friction, integrated from event to event.

    Lengths in that by which the spring of the tip gives way under the bound of friction, times in 1 / w of torsion.
    The base alone moves the tip by b = drive cos r t, with twist by x = b + u;
    u'' + u'/Q + u = -(4/pi) b'' + g F, where F is the force of a spring that holds the tip, or 1 against its motion.

    Returns
    -------
    (u, F) : complex
        Amplitudes at r over the last ten periods.
    """
    end, last = 2.0 * math.pi / r * periods, 2.0 * math.pi / r * (periods - 10)

    def place(t: Any, u: Any) -> Any:
        return u + drive * np.cos(r * t)

    def until_event(t: float, y: Any, anchor: float, sliding: float) -> Any:
        def force(t: Any, u: Any) -> Any:
            return -sliding if sliding else anchor - place(t, u)

        def rate(t: float, y: Any) -> list[float]:
            return [y[1], 4.0 / math.pi * r * r * drive * math.cos(r * t) - y[1] / Q - y[0] + g * force(t, y[0])]

        def event(t: float, y: Any) -> float:
            if sliding:
                return sliding * (drive * r * math.sin(r * t) - y[1])
            return (anchor - place(t, y[0])) ** 2 - 1.0

        event.terminal, event.direction = True, 1.0
        keys = {"method": "DOP853", "dense_output": True, "rtol": 1e-8, "atol": 1e-9, "max_step": 0.4}
        found = solve_ivp(rate, (t, end), y, events=event, **keys)
        sums = np.zeros(2, complex)
        if found.t[-1] > last:
            fine = np.linspace(max(t, last), found.t[-1], 300)
            u = found.sol(fine)[0]
            for i, each in enumerate((u, force(fine, u))):
                sums[i] = trapezoid(each * np.exp(-1j * r * fine), fine)
        return found.t[-1], found.y[:, -1], sums

    t, y, anchor, sliding, sums = 0.0, np.zeros(2), drive, 0.0, np.zeros(2, complex)
    while t < end:
        t, y, more = until_event(t, y, anchor, sliding)
        sums += more
        way = place(t, y[0])
        anchor, sliding = (way - sliding, 0.0) if sliding else (anchor, math.copysign(1.0, way - anchor))
    u, force = 2.0 * sums / (end - last)
    return complex(u), complex(force)


def test_torsion_over_a_surface_grows_with_the_drive_until_the_tip_slips_and_no_further():
    share, quality = 8.0 / math.pi**2, 12.0
    rest, k_tip, bound = stuck_spring(build(InstrumentParameters, LEVER | CONTACT), share)
    g, unit = share * rest / k_tip, bound / rest
    # At the resonance of a tip that sticks.
    r = math.sqrt(1.0 + g)
    stuck = (4.0 / math.pi * r * r - g) / (1j * r / quality)
    least = 1.0 / abs(1.0 + stuck)
    dt = 1.0 / (800 * r * F_TORSION)
    values = LEVER | CONTACT | TWISTING | {"plant.Q_torsion": quality, "plant.dt": dt}
    values |= {"detector.sample_period": 40 * dt, "plant.control_period": 800 * dt}
    values |= {"onboard.drive_frequency": r * F_TORSION, "onboard.time_constant": 1600 * dt}
    values |= {"detector.channels": "in_phase, quadrature, truth/stuck"}
    gains = []
    for over in (0.5, 0.97, 1.5, 4.0):
        drive = over * least
        parameters = build(InstrumentParameters, values | {"onboard.drive_amplitude": drive * unit})
        _, read, _ = held(parameters, 160)
        last = {name: each[-200:] for name, each in read.items()}
        if over < 1.0:
            u, force = stuck * drive, -(1.0 + stuck) * drive
        else:
            u, force = over_friction(r, drive, quality, g, 90)
        assert last["truth/stuck"].all() == (over < 1.0)
        # The photodiode sees the twist of base and mode, and of what follows the force without delay.
        closed = unit * (drive + u + (1.0 - share) * rest / k_tip * force)
        found = complex(last["in_phase"].mean(), -last["quadrature"].mean())
        # What follows without delay is shown with the force of mid-step, half a step late.
        assert found / closed == pytest.approx(1.0, abs=5e-3)
        gains.append(abs(found) / over)
    assert gains[1] / gains[0] == pytest.approx(1.0, abs=1e-3)
    assert gains[2] < 0.8 * gains[0]
    assert gains[3] < 0.4 * gains[0]
