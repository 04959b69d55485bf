"""Claims about the presets: their numbers go together, by closed forms of their own."""

import math

import pytest

from afm_model.plant.presets import ELASTIC, PAIRS, SCANNERS, isotropic, layered


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
