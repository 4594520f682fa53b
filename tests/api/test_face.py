"""Public names of `radarize` and `radarsim`, and the examples in their docstrings."""

import ast
import doctest
import inspect
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import radarize as rz
import radarsim

ROOT = Path(__file__).parents[2]
#: Public names with what they stand for.
PUBLIC = {
    name: getattr(package, name) for package in (rz, radarsim) for name in package.__all__ if name != "__version__"
}
FUNCTIONS = [name for name, each in PUBLIC.items() if inspect.isfunction(each)]


@pytest.mark.parametrize("name", PUBLIC)
def test_examples(name, walk, rec, monkeypatch):
    """Every public name has an example that runs."""
    monkeypatch.chdir(walk.parent)
    names = {"rz": rz, "radarsim": radarsim, "rec": rec}
    found = doctest.DocTestFinder(recurse=False).find(PUBLIC[name], name, globs=names)
    examples = [each for each in found if each.examples]
    assert examples
    output: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert not sum(runner.run(each, out=output.append).failed for each in examples), "".join(output)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_docstrings_say_what_comes_out_and_what_goes_wrong(name):
    text = inspect.getdoc(PUBLIC[name])
    assert all(f"\n{part}:\n" in text for part in ("Args", "Returns", "Raises", "Example"))
    signature = inspect.signature(PUBLIC[name])
    assert signature.return_annotation is not inspect.Parameter.empty
    for parameter in signature.parameters.values():
        assert parameter.annotation is not inspect.Parameter.empty
        assert parameter.name in text


@pytest.mark.parametrize("package", ["radarize", "radarsim"])
def test_type_checkers_see_what_is_there(package):
    """Names imported for type checkers are those of the module, from the same modules."""
    tree = ast.parse((ROOT / package / "__init__.py").read_text())
    (shown,) = (n for n in tree.body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING")
    places = {alias.asname: (node.module, alias.name) for node in shown.body for alias in node.names}
    assert {*places} == {*import_module(package).__all__} - {"__version__"}
    for name, (module, there) in places.items():
        if name != "odometry":  # a package that is called
            assert getattr(import_module(package), name) is getattr(import_module(module), there)


def test_import_loads_nothing_heavy():
    code = "import radarize, radarsim, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    heavy = {"numpy", "torch", "scipy", "numba", "h5py", "gtsam", "matplotlib", "pandas", "xarray", "pydantic", "typer"}
    assert "radarize" in done.stdout and not heavy & {*done.stdout.split()}


def test_what_is_not_there_is_an_attribute_error():
    for module in (rz, radarsim):
        assert {*module.__all__} <= {*dir(module)} | {"odometry"}
        with pytest.raises(AttributeError, match="has no attribute 'magic'"):
            module.magic  # noqa: B018


def test_odometry_stays_a_package():
    """The function and the package of the name `odometry` are the same in any order of imports."""
    from radarize.odometry import uncertainty

    assert rz.odometry.uncertainty is uncertainty and callable(rz.odometry)
