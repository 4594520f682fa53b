"""Buildings and recordings that a specification lists together."""

from pathlib import Path

import pytest

from radarize.io.errors import InputError
from radarsim.dataset.specification import Specification

HEAD = """
name: many
seed: 3
variants: {plain: {}, coarse: {radar: {samples: 48}}, low: {mounting: [0, 0, -0.3, 0, 0, 0]}}
"""
LISTED = """
buildings: {A5: {kind: A, seed: 5}, A6: {kind: A, seed: 6}, B9: {kind: B, seed: 9}}
recordings:
  - {building: A5, floors: [0], platform: cart, count: 1, duration: 1, variants: [plain]}
  - {building: A6, floors: [0], platform: cart, count: 1, duration: 1, variants: [coarse]}
  - {building: B9, floors: [0], platform: cart, count: 1, duration: 1, variants: [low]}
"""
TOGETHER = """
buildings: {A: {kind: A, seeds: [5, 6]}, B: {kind: B, seeds: [9, 9]}}
recordings:
  - {building: "*", floors: [0], platform: cart, count: 1, duration: 1, by_turns: true}
"""


def loaded(tmp_path: Path, text: str) -> Specification:
    path = tmp_path / "many.yaml"
    path.write_text(HEAD + text)
    return Specification.load(path)


def test_seeds_and_patterns_stand_for_each_building(tmp_path):
    listed, together = (loaded(tmp_path, text) for text in (LISTED, TOGETHER))
    assert [task.parameters for task in together.tasks] == [task.parameters for task in listed.tasks]
    assert [task.name for task in together.tasks] == ["A5_0_cart_00_plain", "A6_0_cart_00_coarse", "B9_0_cart_00_low"]
    everywhere = loaded(tmp_path, TOGETHER.replace("by_turns: true", "variants: [plain, low]").replace('"*"', '"A?"'))
    assert len(everywhere.tasks) == 4


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('"*"', '"C*"', "building is 'C*', expected one of buildings: A5, A6, B9"),
        ("[5, 6]", "[6, 5]", r"seeds of A are [6, 5], expected [first, last]"),
        ("[5, 6]", "5", "seeds of A are 5, expected [first, last]"),
        ("[5, 6]", "[5, 9999999999]", "seeds of A are [5, 9999999999], expected [first, last], at most"),
    ],
)
def test_mistakes_are_one_sentence(tmp_path, old, new, expected):
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, TOGETHER.replace(old, new))
    assert expected in str(caught.value) and "\n" not in str(caught.value)
