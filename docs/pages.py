"""Lay out the pages for mkdocs in `build/pages` as in the repository, so that links have the same targets."""

import re
import shutil
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "build" / "pages"
LINK = re.compile(r"\]\(([^)#:]+)\)")
#: A link to a folder, which a site has none of.
FOLDER = re.compile(r"\[([^]]+)\]\([^)#:]+/\)")
#: Notebooks as pages, with their outputs, and a link to a notebook.
NOTEBOOKS, NOTEBOOK = ROOT / "build" / "notebooks" / "pages", re.compile(r"(\]\([^):]+)\.ipynb\)")


def lay_out() -> None:
    """Copy the pages and every file that one of them links to."""
    shutil.rmtree(PAGES, ignore_errors=True)
    pages = [*(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks" / "results").glob("*.md")]
    pages += [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")]
    pages.append(ROOT / "radarize" / "learning" / "weights" / "README.md")
    linked = {(page.parent / link).resolve() for page in pages for link in LINK.findall(page.read_text())}
    for path in {*pages, *(path for path in linked if path.is_file())}:
        place = PAGES / path.relative_to(ROOT)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, place)
        if path.suffix == ".md":
            place.write_text(for_site(path.read_text()))
    shutil.copytree(NOTEBOOKS, PAGES / "notebooks")
    for page in (PAGES / "notebooks").glob("*.md"):
        page.write_text(for_site(page.read_text()))


def for_site(text: str) -> str:
    """A page with links to pages alone."""
    return NOTEBOOK.sub(r"\1.md)", FOLDER.sub(r"\1", text))


if __name__ == "__main__":
    lay_out()
