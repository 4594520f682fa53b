"""A benchmark's page in a browser: tables sort, lines toggle, and there are no errors."""

from pathlib import Path

import pytest

from radarize.evaluation.benchmark.run import benchmark
from radarize.evaluation.benchmark.study import Options
from tests.capture.browser import CHROMIUM, Browser
from tests.evaluation.benchmark.rooms import write_rooms
from tests.evaluation.benchmark.toys import add

CELLS = "[...document.querySelectorAll('table.sortable')[{0}].rows].slice(1).map(r => r.cells[{1}].textContent)"
CLICK = "document.querySelectorAll('table.sortable')[{0}].rows[0].cells[{1}].click()"
SHOWN = "document.getElementById('plot-1').data.map(line => line.visible)"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Pages of two methods with different errors, and one method that cannot run."""
    data, output = write_rooms(tmp_path_factory.mktemp("rooms")), tmp_path_factory.mktemp("page")
    with pytest.MonkeyPatch.context() as patch:
        methods = [*add(patch), "doppler", "segmentation"]
        for name in ("buildings", "mapping"):
            benchmark(name, data, output, Options(methods))
    return output


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (apt-get install chromium)")
def test_it_sorts_and_toggles(folder, tmp_path):
    with Browser((folder / "buildings.html").as_uri(), tmp_path / "profile") as browser:
        browser.wait("document.querySelectorAll('.js-plotly-plot').length === 3")
        assert browser.evaluate("document.querySelector('h1').textContent") == "SLAM in unseen buildings"
        # Numbers sort by value, in both directions, and text alphabetically.
        heads = "[...document.querySelector('table.sortable').rows[0].cells].map(c => c.textContent)"
        column = browser.evaluate(heads).index("ATE m")
        before = browser.evaluate(CELLS.format(0, column))
        for down in (False, True):
            browser.evaluate(CLICK.format(0, column))
            assert browser.evaluate(CELLS.format(0, column)) == sorted(before, key=float, reverse=down)
        browser.evaluate(CLICK.format(0, 2))
        assert browser.evaluate(CELLS.format(0, 2)) == ["A", "A", "B", "B", "mean", "mean"]
        # The menu of the first plot selects a recording: three lines for each of three recordings.
        shown = browser.evaluate(SHOWN)
        assert shown == [True] * 3 + [False] * 6
        assert browser.evaluate("document.querySelectorAll('#plot-1 .updatemenu-container').length") == 1
        names = browser.evaluate("document.getElementById('plot-1').data.map(line => line.name)")
        assert names[:3] == ["truth", "scaled+metre", "doppler+metre"]
        # A click on a name hides its line.
        click = "const e = document.querySelectorAll('#plot-1 .legendtoggle')[1];"
        click += "for (const k of ['mousedown', 'mouseup']) e.dispatchEvent(new MouseEvent(k, {bubbles: true})); 0"
        browser.evaluate(f"(() => {{ {click.removesuffix('0')} }})()")
        browser.wait(f"{SHOWN}[1] === 'legendonly'")
        assert browser.evaluate("document.querySelectorAll('figure img').length") == 3  # maps, a row a recording
        browser.screenshot(tmp_path / "page.png")
        assert browser.errors == []


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (apt-get install chromium)")
def test_the_index_leads_to_the_pages(folder, tmp_path):
    with Browser((folder / "index.html").as_uri(), tmp_path / "profile") as browser:
        browser.wait("document.readyState === 'complete'")
        assert browser.evaluate("[...document.links].map(l => l.textContent)") == [
            "SLAM in unseen buildings",
            "Scans and maps",
        ]
        browser.evaluate("document.links[1].click()")
        browser.wait("document.querySelector('h1')?.textContent === 'Scans and maps'")
        browser.wait("document.querySelectorAll('table.sortable').length === 1")
        text = browser.evaluate("document.body.innerText")
        assert "does not fit this radar" in text and "Data: rooms, 2 recordings" in text and "metre" in text
        assert browser.errors == []
