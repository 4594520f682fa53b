"""Build step: `scenes/` of the repository is `radarsim/scenes` where it is installed; pyproject.toml cannot do this."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithScenes(build_py):
    def run(self):
        super().run()
        if not self.editable_mode:
            shutil.copytree("scenes", Path(self.build_lib, "radarsim", "scenes"), dirs_exist_ok=True)


setup(cmdclass={"build_py": BuildWithScenes})
