from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Public recordings beside the repository."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "recordings"
    if not folder.is_dir():
        pytest.skip(f"the public recordings are not at {folder}")
    return folder
