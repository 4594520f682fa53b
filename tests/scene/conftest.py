import pytest

from radarsim.scene.scene import Scene


@pytest.fixture(scope="session")
def office() -> Scene:
    return Scene.load("office")
