"""Pages of benchmarks, one file each, and an index over those in a folder."""

from pathlib import Path

from radarize.benchmark.benchmark import Study
from radarize.benchmark.results import Results
from radarize.benchmark.table import cell
from radarize.errors import InputError
from radarize.jsonfile import read_json
from radarize.report.page import Link, Page


def write_page(study: Study, results: Results, path: Path) -> Path:
    """Tables that sort on click, then the benchmark's drawings.

    Raises:
        InputError: it cannot be written, or a run's file is damaged.
    """
    page = Page(results.title, study.benchmark.about)
    for table in results.tables:
        page.section(table.title)
        if table.rows:
            head = tuple(table.rows[0])
            rows = [tuple(cell(value) for value in row.values()) for row in table.rows]
            page.table(head, rows, table.numbers(), sortable=True)
        for note in table.notes:
            page.text(note)
    study.benchmark.draw(study, page)
    page.section("Data, networks, machine")
    for note in results.notes:
        page.text(note)
    page.columns({"Made by": {"command": results.command, "seed": results.seed, **results.machine}})
    return page.write(path)


def write_index(folder: Path) -> Path:
    """A page that leads to those of a folder.

    Raises:
        InputError: it cannot be written.
    """
    page = Page("Benchmarks", f"Comparisons in {folder.resolve().name}")
    rows = []
    for path in sorted(folder.glob("*.html")):
        try:
            about = read_json(path.with_suffix(".json"))
        except InputError:
            continue
        if "tables" in about:
            made = about.get("machine", {})
            rows.append((Link(about["title"], path.name), made.get("commit", "-"), made.get("processor", "-")))
    page.table(("benchmark", "commit", "processor"), rows)
    return page.write(folder / "index.html")
