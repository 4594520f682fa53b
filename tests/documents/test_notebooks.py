"""Notebooks are whole, without outputs, and what they import is there; `make notebooks` runs them."""

import ast
import importlib
import re
from pathlib import Path

import nbformat
import pytest
import yaml

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
LINK = re.compile(r"\]\(([^)\s]+)\)")


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def notebook(request):
    return nbformat.read(request.param, as_version=4)


def sources(notebook, kind: str) -> list[str]:
    return [cell.source for cell in notebook.cells if cell.cell_type == kind]


def test_there_are_six_and_the_site_has_them():
    named = re.findall(r"notebooks/(\w+)\.md", yaml.safe_dump(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]))
    assert named == [path.stem for path in NOTEBOOKS] and len(named) == 6


def test_it_is_valid_and_without_outputs(notebook):
    nbformat.validate(notebook)
    for cell in notebook.cells:
        assert cell.cell_type == "markdown" or (not cell.outputs and cell.execution_count is None)
        assert not cell.metadata


def test_it_begins_with_a_title_and_explains_itself(notebook):
    assert re.match(r"# \d\. ", notebook.cells[0].source)
    assert len(sources(notebook, "markdown")) >= len(sources(notebook, "code")) - 1


def test_its_code_parses_and_draws_with_units(notebook):
    code = "\n".join(sources(notebook, "code"))
    ast.parse(code)
    labels = re.findall(r"[xy]label=f?\"([^\"]+)\"", code)
    assert "plt.subplots" in code
    assert all(label in ("epoch", "channel") or "," in label or label == "ADC counts" for label in labels)


def test_what_it_imports_is_there(notebook):
    for node in ast.walk(ast.parse("\n".join(sources(notebook, "code")))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                importlib.import_module(alias.name)
        elif isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module)
            assert all(hasattr(module, alias.name) for alias in node.names)


def test_names_of_the_packages_exist(notebook):
    """`rz.run` is there, and so is everything else that cells take from the two packages."""
    import radarize
    import radarsim

    packages = {"rz": radarize, "radarsim": radarsim}
    for node in ast.walk(ast.parse("\n".join(sources(notebook, "code")))):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in packages:
            assert hasattr(packages[node.value.id], node.attr), node.attr


def test_links_lead_somewhere(notebook):
    links = [link for text in sources(notebook, "markdown") for link in LINK.findall(text) if "://" not in link]
    assert not [link for link in links if not (ROOT / "notebooks" / link.split("#")[0]).exists()]
