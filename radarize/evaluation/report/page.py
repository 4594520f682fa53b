"""A self-contained HTML page: sections of text, tables, pictures and interactive plots, in light and dark mode.

The layout is in ``templates``. All content is escaped, because names and attributes are data.
"""

import base64
import io
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from radarize.io.replacing import write_whole

if TYPE_CHECKING:  # pages without plots need neither library
    from matplotlib.figure import Figure
    from plotly.graph_objects import Figure as PlotlyFigure

#: Colours that are legible on light and dark backgrounds: axes and text of plots, grid lines, and one per quantity.
INK, GRID = "#7d8590", "rgba(125,133,144,0.22)"
COLORS = {"truth": "#8b949e", "slam": "#2a7fd4", "odometry": "#e4572e", "map": "#9a6fd0", "good": "#2e9e6b"}
#: Colours of other methods in a comparison.
OTHERS = (
    "#e4572e #9a6fd0 #c2881c #1f9e9e #c04f8a #7d8590 #6d8f2e #8a5a3c #5b6ee1 #d98fb0 #4f9d69 #b5651d #3f6f8f #a3a33b"
).split()

_TEMPLATES = Environment(
    loader=PackageLoader("radarize.evaluation.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
    lstrip_blocks=True,
)  # fmt: skip
STYLE = _TEMPLATES.get_template("style.css").render()


class Link(NamedTuple):
    """A table cell that links to a file in the folder of the page."""

    words: str
    file: str


class Page:
    """Collects sections and writes them as one self-contained file."""

    def __init__(self, title: str, about: str = ""):
        self._title, self._about = title, about
        self._body: list[tuple[str, dict[str, object]]] = []

    def _add(self, kind: str, **content: object) -> None:
        """Add a block that ``blocks.html`` has a macro for."""
        self._body.append((kind, content))

    def section(self, title: str, about: str = "") -> None:
        """Start a section."""
        self._add("section", title=title, about=about)

    def text(self, words: str) -> None:
        """Add a paragraph."""
        self._add("text", words=words)

    def headline(self, figures: Iterable[tuple[str, str]]) -> None:
        """Add figures in large type, as (value, description)."""
        self._add("headline", figures=list(figures))

    def table(
        self,
        head: Sequence[str],
        rows: Iterable[Sequence[object]],
        numbers: Collection[int] = (),
        sortable: bool = False,
    ) -> None:
        """Add a table. Columns listed in `numbers` are right-aligned, and sort by value if the table is sortable."""
        self._add("table", head=head if any(head) else (), rows=list(rows), numbers=numbers, sortable=sortable)

    def columns(self, parts: Mapping[str, Mapping[str, object]], numbers: Collection[int] = ()) -> None:
        """Add nested plain data as tables of dotted names side by side, by title; `numbers` as in `table`."""
        tables = [(title, list(_flat(content))) for title, content in parts.items() if content]
        self._add("columns", parts=tables, numbers=numbers)

    def picture(self, figure: "Figure", caption: str = "") -> None:
        """Add a matplotlib figure as a transparent PNG."""
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=130, transparent=True, bbox_inches="tight")
        self._add("picture", data=base64.b64encode(buffer.getvalue()).decode(), caption=caption)

    def plot(self, figure: "PlotlyFigure", height: int = 380) -> None:
        """Add an interactive plotly figure in the page's style."""
        figure.update_layout(
            height=height,
            margin={"l": 60, "r": 20, "t": 30, "b": 50},
            paper_bgcolor="rgba(0,0,0,0)",
            plot_bgcolor="rgba(0,0,0,0)",
            font={"color": INK, "size": 13, "family": "system-ui, sans-serif"},
            legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
            hovermode="closest",
            modebar={"bgcolor": "rgba(0,0,0,0)", "color": GRID, "activecolor": INK},
        )
        figure.update_xaxes(gridcolor=GRID, zeroline=False, linecolor=GRID)
        figure.update_yaxes(gridcolor=GRID, zeroline=False, linecolor=GRID)
        content = figure.to_html(
            full_html=False,
            include_plotlyjs=False,
            include_mathjax=False,
            config={"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": ["select2d", "lasso2d"]},
            div_id=f"plot-{1 + self._plots}",
        )
        self._add("plot", content=Markup(content))

    @property
    def _plots(self) -> int:
        return sum(kind == "plot" for kind, _ in self._body)

    def write(self, path: Path) -> Path:
        """Write the page.

        Raises:
            InputError: it cannot be written.
        """
        plotly = ""
        if self._plots:
            from plotly.offline import get_plotlyjs

            plotly = Markup(get_plotlyjs())
        page = _TEMPLATES.get_template("page.html")
        return write_whole(path, page.render(title=self._title, about=self._about, body=self._body, plotly=plotly))


def _flat(content: Mapping[str, object], prefix: str = "") -> Iterable[tuple[str, str]]:
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        elif isinstance(value, float):
            yield f"{prefix}{name}", f"{value:.6g}"
        elif value not in ("", None):
            yield f"{prefix}{name}", str(value)
