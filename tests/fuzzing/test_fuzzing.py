"""Every reader of foreign bytes on damaged and hostile input; `benchmarks/fuzzing.py` runs the same for longer."""

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from tests.fuzzing.reader import attempt, clear
from tests.fuzzing.readers import READERS
from tests.fuzzing.worlds import WORLDS

#: Inputs by reader, as far as they fit into a few seconds in all.
EXAMPLES = {name: 30 if name.startswith("ROS") or name in WORLDS else 75 for name in READERS}


@pytest.mark.filterwarnings("ignore")  # numpy and scipy about numbers that make no sense
@pytest.mark.parametrize("name", READERS)
def test_every_input_ends_in_a_result_or_in_one_sentence(name, tmp_path):
    reader = READERS[name]()

    @settings(
        max_examples=EXAMPLES[name],
        deadline=None,
        database=None,
        derandomize=True,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(reader.inputs)
    def try_one(data):
        clear(tmp_path)  # of what an input that failed has left
        attempt(reader, data, tmp_path)

    try_one()
