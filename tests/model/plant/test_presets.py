"""Claims about the presets: their numbers go together, by closed forms of their own."""

import cmath
import math

import pytest
from scipy.special import kv

from afm_model.plant.lever import LeverGroup
from afm_model.plant.presets import ELASTIC, LEVERS, PAIRS, SCANNERS, isotropic, layered

E, G = 169e9, 50.9e9
"""Of silicon along <110> on a wafer (001) [Pa]."""
OF_SILICON = ("ppp_lfmr", "contal_g", "ppp_fmr", "nsc14", "ppp_nchr")
SILICON, ALUMINIUM = 2329.0, 2700.0
"""Densities [kg/m^3]."""
COATING, HALF_ANGLE = 30e-9, math.radians(25.0)
"""Aluminium on the back of a cantilever [m]; a silicon tip as a cone."""


@pytest.mark.parametrize(("name", "of_f0"), [(name, 0.02) for name in OF_SILICON])
def test_stiffness_resonance_and_twist_of_a_cantilever_are_those_of_silicon_in_its_dimensions(name, of_f0):
    c = LEVERS[name]
    # The makers round the thickness; k, of its cube, tells it better.
    t = c.length * (4.0 * c.k / (E * c.width)) ** (1.0 / 3.0)
    assert t == pytest.approx(c.thickness, rel=0.05)
    tip = SILICON * math.pi / 3.0 * c.tip_height**3 * math.tan(HALF_ANGLE) ** 2
    # A beam moves as 0.2427 of its mass would at the end, where the tip stands.
    mass = 0.2427 * c.length * c.width * (SILICON * t + ALUMINIUM * COATING) + tip
    assert c.f0 == pytest.approx(math.sqrt(c.k / mass) / (2.0 * math.pi), rel=of_f0)
    J = c.width * t**3 / 3.0 * (1.0 - 0.63 * t / c.width)
    assert LeverGroup(lever=name).cantilever_numbers.k_torsion == pytest.approx(G * J / c.length, rel=1e-3)


def test_arms_of_a_v_are_beams_of_nitride_to_a_quarter():
    # Of the table that its dimensions are from; density of the film 3100 kg/m^3.
    c, modulus = LEVERS["snl_10b"], 304e9
    k = 2.0 * modulus * c.width * c.thickness**3 / (4.0 * c.length**3)
    assert k == pytest.approx(c.k, rel=0.25)
    mass = 0.2427 * 2.0 * c.length * c.width * 3100.0 * c.thickness
    assert c.f0 == pytest.approx(math.sqrt(c.k / mass) / (2.0 * math.pi), rel=0.25)


@pytest.mark.parametrize("name", OF_SILICON)
def test_damping_of_a_cantilever_is_that_of_its_air_or_somewhat_more(name):
    """J. E. Sader, J. Appl. Phys. 84 (1998) 64, doi:10.1063/1.368002, of a circle as wide: 10 % off at most."""
    c, density, viscosity = LEVERS[name], 1.18, 1.86e-5
    reynolds = density * 2.0 * math.pi * c.f0 * c.width**2 / (4.0 * viscosity)
    root = cmath.sqrt(1j * reynolds)
    drag = 1.0 + 4j * kv(1, -1j * root) / (root * kv(0, -1j * root))
    mass = c.k / (0.2427 * (2.0 * math.pi * c.f0) ** 2) / c.length
    of_air = (4.0 * mass / (math.pi * density * c.width**2) + drag.real) / drag.imag
    assert 0.7 * of_air < c.Q < of_air


@pytest.mark.parametrize("name", PAIRS)
def test_hamaker_constant_and_work_of_adhesion_of_a_pair_go_together(name):
    pair = PAIRS[name]
    assert pair.work_of_adhesion == pytest.approx(pair.hamaker / (12.0 * math.pi * pair.range**2), rel=0.03)
    # Shear strength is below the theoretical one of a crystal, G / 2 pi.
    assert pair.tau < 2.0 * pair.G / (2.0 * math.pi)


@pytest.mark.parametrize("name", SCANNERS)
def test_stiffness_and_resonance_of_a_scanner_move_the_same_mass(name):
    s = SCANNERS[name]
    for k, f in ((s.k_x, s.f_x), (s.k_y, s.f_y), (s.k_z, s.f_z)):
        assert 1e-3 <= k / (2.0 * math.pi * f) ** 2 <= 0.1


def test_layers_with_equal_directions_are_an_isotropic_material_and_those_of_graphite_are_not():
    E, nu = 70e9, 0.17
    G, lame = E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    equal = layered(lame + 2.0 * G, lame, lame, lame + 2.0 * G, G)
    assert equal == pytest.approx(isotropic(E, nu))
    # Soft to indent, stiff sideways, where the layer itself of c66 = 485 GPa is sheared.
    assert 1.0 / ELASTIC["graphite"].plane == pytest.approx(27.0e9, rel=0.01)
    assert 1.0 / ELASTIC["graphite"].shear == pytest.approx(29.2e9, rel=0.01)
