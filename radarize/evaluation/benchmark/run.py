"""`radarize benchmark`: compare methods on a folder of recordings, and write tables and pages."""

from collections.abc import Callable
from pathlib import Path

from matplotlib import pyplot

from radarize.evaluation.benchmark.archive import bags, import_archive
from radarize.evaluation.benchmark.dataset import DataSet
from radarize.evaluation.benchmark.results import Results, machine
from radarize.evaluation.benchmark.study import BENCHMARKS, Benchmark, Options, Study, carry_out
from radarize.evaluation.benchmark.table import cell
from radarize.evaluation.report.page import Link, Page
from radarize.io.errors import InputError
from radarize.io.jsonfile import read_json
from radarize.io.replacing import replacing

#: Name for all benchmarks that the data is suitable for.
ALL = "all"


def benchmark(
    name: str,
    data: Path,
    output: Path,
    options: Options = Options(),  # noqa: B008
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
    log: Callable[[str], None] = lambda line: None,
) -> dict[str, Results]:
    """Compare methods. If it is interrupted, the same call continues after the last run that has ended.

    Args:
        name: a key of `BENCHMARKS`, or ``all``.
        data: folder of recordings, or of bags of the Radarize data set, which are imported to `output`/recordings.
        output: folder to write: NAME.json, NAME.md and NAME.html for each benchmark (NAME.png if it has plots), and
            index.html; ``runs``, ``timings`` and ``weights``, which are used again.
        options: methods, networks and protocol.
        progress: called with (frames done, frames in all).
        log: called with a line for each benchmark that the data is not suitable for, and for each that does not compare
            all requested methods.

    Returns:
        Results by name.

    Raises:
        InputError: an unknown name, or data that is not suitable.
    """
    known = {each: of for each, of in BENCHMARKS.items() if isinstance(of, Benchmark)}
    if name != ALL and name not in known:
        raise InputError(f"benchmark is {name!r}, expected one of: {', '.join((*known, ALL))}")
    options.check()
    machine()  # read now, because sources may change during a long run
    output = Path(output)
    if bags(Path(data)):
        data = import_archive(Path(data), output / "recordings", progress)
    found = DataSet.load(data)
    studies: dict[str, Study] = {}
    for each in known if name == ALL else (name,):
        try:
            studies[each] = Study.plan(known[each], found, output, options)
        except InputError as error:
            if name != ALL:
                raise
            log(f"{each}: left out, {error}")
        else:
            for words in studies[each].left_out:
                log(f"{each}: {words}")
    if not studies:
        raise InputError(f"{data}: is not suitable for any benchmark")
    carry_out(list(studies.values()), progress)
    published = {each: _publish(each, study) for each, study in studies.items()}
    write_index(output)
    return published


def _publish(name: str, study: Study) -> Results:
    results = study.publish()
    if (figure := study.benchmark.picture(study, results.tables)) is not None:
        with replacing(study.output / f"{name}.png") as part:
            figure.savefig(part, format="png", dpi=70, bbox_inches="tight")
        pyplot.close(figure)
        results.notes.append(f"![{results.title}]({name}.png)")
    results.write(study.output, name)
    write_page(study, results, study.output / f"{name}.html")
    return results


def write_page(study: Study, results: Results, path: Path) -> Path:
    """Write a page with sortable tables, and the figures of the benchmark.

    Raises:
        InputError: it cannot be written, or a run's file is damaged.
    """
    page = Page(results.title, study.benchmark.about)
    for table in results.tables:
        page.section(table.title)
        if table.rows:
            rows = [tuple(map(cell, row)) for row in table.frame.itertuples(index=False)]
            page.table(tuple(table.frame), rows, table.numbers(), sortable=True)
        for note in table.notes:
            page.text(note)
    study.benchmark.draw(study, page)
    page.section("Data, networks, machine")
    for note in results.notes:
        page.text(note)
    for name, words in results.facts.items():
        page.text(f"{name}: {words}.")
    return page.write(path)


def write_index(folder: Path) -> Path:
    """Write an index of the pages of a folder.

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
