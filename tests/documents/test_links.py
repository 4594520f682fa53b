"""Links between pages have targets, and the site includes all pages."""

import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
PAGES = [
    *ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks" / "results").glob("*.md"),
    ROOT / "radarize" / "learning" / "weights" / "README.md",
]  # fmt: skip
LINK = re.compile(r"\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    links = [link for link in LINK.findall(FENCE.sub("", page.read_text())) if "://" not in link]
    assert not [link for link in links if not (page.parent / link.split("#")[0]).exists()]


def test_the_site_has_every_page():
    """All pages except those of benchmarks."""
    notebooks = {f"notebooks/{path.stem}.md" for path in (ROOT / "notebooks").glob("*.ipynb")}  # written with it
    settings = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
    named = set(re.findall(r"[\w/-]+\.md", yaml.safe_dump(settings["nav"])))
    pages = {str(page.relative_to(ROOT)) for page in PAGES if "results" not in page.parts}
    assert named == pages | notebooks


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 110
