from dataclasses import dataclass

import jaxtyping
import numpy as np
import pytest
from jaxtyping import Float, TypeCheckError

from tests import checked
from tests.checked import FIRST, ONE_OF


def corner(points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "2"]:
    return points[0]


@dataclass
class Corner:
    points: Float[np.ndarray, "n 2"]


@pytest.mark.parametrize("thing", [corner, Corner])
def test_wrong_shapes_are_found_in_the_first_calls_and_in_some_later_ones(thing):
    looked_at = jaxtyping.jaxtyped(typechecker=checked.arrays)(thing)

    def found(shape: tuple[int, ...]) -> bool:
        try:
            looked_at(np.zeros(shape))
        except TypeCheckError:
            return True
        return False

    assert not found((4, 2))
    assert sum(found((4, 3)) for _ in range(FIRST - 1 + 10 * ONE_OF)) == FIRST - 1 + 10
    checked.begin_test()
    assert sum(found((4, 3)) for _ in range(FIRST)) == FIRST


def test_what_has_no_arrays_is_left_as_it_is():
    def named(name: str) -> str:
        return name.title()

    assert jaxtyping.jaxtyped(typechecker=checked.arrays)(named) is named
