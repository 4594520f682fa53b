import pytest

from radarsim.world.scene import Scene


@pytest.fixture(scope="session")
def office() -> Scene:
    return Scene.load("office")
