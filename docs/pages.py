"""Lays out the pages for mkdocs in `build/pages`: as in the repository, so that links lead where they lead there, with
README as the start page and the reference of commands, generated from the command lines.
"""

import re
import shutil
from pathlib import Path

import typer
from typer.core import TyperCommand

from radarize import cli as radarize
from radarsim import cli as radarsim

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
    reference = ["# Commands", "", "`--debug` shows the traceback of an error.", ""]
    for name, app in (("radarize", radarize.app), ("radarsim", radarsim.app)):
        reference += described(name, typer.main.get_command(app))
    (PAGES / "docs" / "reference" / "commands.md").write_text("\n".join(reference))


def for_site(text: str) -> str:
    """A page with links to pages alone."""
    return NOTEBOOK.sub(r"\1.md)", FOLDER.sub(r"\1", text))


def described(name: str, command: TyperCommand) -> list[str]:
    """Markdown of a command, or of all below it."""
    if hasattr(command, "commands"):
        return [line for below in command.commands.values() for line in described(f"{name} {below.name}", below)]
    lines = [f"## {name}", "", " ".join((command.help or "").split()), "", "| | | |", "|---|---|---|"]
    for parameter in command.params:
        if parameter.name == "help":
            continue
        option = parameter.opts[0].startswith("-")
        flags = ", ".join(parameter.opts) if option else parameter.metavar or parameter.name.upper()
        default = parameter.default if isinstance(parameter.default, str | int | float | Path) else ""
        known = "" if default in ("", False) else f"default `{default}`"
        about = " ".join((getattr(parameter, "help", "") or "").split()).replace("|", "\\|")
        lines.append(f"| `{flags}` | {about} | {known} |")
    return [*lines, ""]


if __name__ == "__main__":
    lay_out()
