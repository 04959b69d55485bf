"""Claims about the modes of a cantilever, against finite elements."""

import numpy as np
import pytest

from afm_model.cantilever import beam

from .beam_elements import ElementBeam


def test_modes_have_the_frequencies_and_what_is_left_the_compliance_of_finite_elements():
    elements = ElementBeam(1.0, 1.0, 1.0)
    # 60 elements: error (x/60)^4 / 720, below 1e-6 in the third mode.
    assert [mode.frequency for mode in beam.MODE] == pytest.approx(elements.frequencies()[:3], rel=1e-6)
    for count in (1, 2, 3):
        rest = beam.rest(count)
        found = np.array([[rest.end_by_force, rest.turn_by_force], [rest.turn_by_force, rest.turn_by_couple]])
        assert np.linalg.eigvalsh(found).min() > 0.0
        for mode in beam.MODE[:count]:
            found += mode.compliance * np.outer([1.0, mode.slope], [1.0, mode.slope])
        assert found == pytest.approx(elements.compliance(), rel=1e-9)


@pytest.mark.parametrize(("count", "first", "second"), [(1, 0.35, None), (2, 2e-3, 0.5), (3, 2e-4, 5e-3)])
def test_two_modes_and_a_static_rest_meet_the_first_contact_resonance_and_three_the_second(count, first, second):
    # A tip pinned by 850 k: resonances of the modes, coupled through spring and rest, against finite elements.
    exact = ElementBeam(1.0, 1.0, 1.0).frequencies(np.diag([850.0, 0.0]))
    w2 = np.array([mode.frequency**2 for mode in beam.MODE[:count]])
    compliance = np.array([mode.compliance for mode in beam.MODE[:count]])
    spring = 1.0 / (beam.rest(count).end_by_force + 1.0 / 850.0)
    coupled = np.diag(w2) + spring * np.outer(w2 * compliance, np.ones(count))
    found = np.sqrt(np.sort(np.linalg.eigvals(coupled).real))
    assert found[0] == pytest.approx(exact[0], rel=first)
    if second is not None:
        assert found[1] == pytest.approx(exact[1], rel=second)
    if count == 1:
        # One mode alone, or a lumped mass, is wrong by a third and more.
        assert abs(found[0] / exact[0] - 1.0) > 0.3
