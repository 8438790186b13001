"""Newton's method that goes to and fro between two iterates is told from one that is on its way."""

import pytest

from mechanical_fmu.newton import goes_round, in_vain

# Relative residuals of a block that rests on two corners and slips (recorded).
TO_AND_FRO = (0.0468, 8.4e-05, 4.41e-04, 3.28e-04, 3.18e-05, 4.3e-04, 3.18e-05, 4.3e-04)


@pytest.mark.parametrize(("n", "around"), [(2, False), (5, False), (7, False), (8, True)])
def test_four_iterates_tell(n, around):
    assert goes_round(TO_AND_FRO[:n]) is around


@pytest.mark.parametrize("history", [
    # Hardly anything changes for a while, and then all of it: a front of slip that crosses a surface.
    (0.151, 9.16e-4, 0.0173, 0.0186, 0.0186, 0.0186, 0.0186),
    # Slow but sure.
    (1.0, 0.1, 0.9, 0.09, 0.8, 0.08),
    # Round-off.
    (0.0, 0.0, 0.0, 0.0),
])
def test_others_go_on(history):
    assert not any(goes_round(history[:n]) for n in range(len(history) + 1))


def test_it_is_said():
    assert in_vain(TO_AND_FRO, True) == ("no equilibrium after 7 iterations, which go to and fro between two states of "
                                         "contact")
    assert in_vain(TO_AND_FRO, False) == "no equilibrium after 7 iterations"
