from collections.abc import Iterator

import numpy as np
import pytest

from tests.emulator.client import SMALL, Client, attached
from tests.virtual import record


@pytest.fixture
def playing(tmp_path) -> Iterator[tuple[Client, np.ndarray, list[str]]]:
    """Emulator that plays a small recording."""
    adc = record(tmp_path / "small.h5", SMALL, 12)
    with attached(tmp_path / "small.h5") as (_, client, lines):
        yield client, adc, lines
