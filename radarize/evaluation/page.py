"""A self-contained HTML page: sections of text, tables, pictures and interactive plots, light and dark."""

import base64
import html
import io
from collections.abc import Iterable, Mapping
from pathlib import Path

from radarize.replacing import write_whole

#: Readable on light and dark ground alike: axes and text of plots, and one colour per meaning.
INK, GRID = "#7d8590", "rgba(125,133,144,0.22)"
COLORS = {"truth": "#8b949e", "slam": "#e4572e", "odometry": "#2a7fd4", "map": "#9a6fd0", "good": "#2e9e6b"}

STYLE = """
:root { color-scheme: light dark; --ink: #1c2128; --soft: #5c6570; --ground: #ffffff; --card: #f6f7f9; --line: #dfe3e8;
  --accent: #e4572e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e9ee; --soft: #9aa4b0; --ground: #14171b; --card: #1c2026;
  --line: #2d333b; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 48px 24px 96px; }
header { border-bottom: 1px solid var(--line); padding-bottom: 20px; margin-bottom: 28px; }
h1 { font-size: 30px; line-height: 1.2; letter-spacing: -0.015em; margin: 0 0 6px; font-weight: 650; }
h2 { font-size: 20px; letter-spacing: -0.01em; margin: 52px 0 6px; font-weight: 620; }
h3 { font-size: 14px; color: var(--soft); margin: 22px 0 6px; font-weight: 600; }
p { margin: 4px 0 14px; color: var(--soft); max-width: 76ch; }
.headline { display: grid; grid-template-columns: repeat(auto-fit, minmax(190px, 1fr)); gap: 12px; margin: 20px 0 8px; }
.headline div { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 14px 16px; }
.headline b { display: block; font-size: 26px; letter-spacing: -0.02em; font-weight: 650;
  font-variant-numeric: tabular-nums; }
.headline span { color: var(--soft); font-size: 13.5px; line-height: 1.35; display: block; }
table { border-collapse: collapse; width: 100%; font-size: 14.5px; margin: 8px 0 18px; }
th { text-align: left; color: var(--soft); font-weight: 600; font-size: 13px; }
th, td { padding: 7px 14px 7px 0; border-bottom: 1px solid var(--line); vertical-align: top; overflow-wrap: anywhere; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.note { color: var(--soft); }
figure { margin: 8px 0 18px; }
figure img { max-width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: 13.5px; }
.columns { display: grid; grid-template-columns: repeat(auto-fit, minmax(300px, 1fr)); gap: 8px 32px; }
.wide { overflow-x: auto; }
a { color: var(--accent); }
table.sortable th, table.sortable td { overflow-wrap: normal; padding-right: 18px; }
table.sortable td { white-space: nowrap; }
table.sortable th { cursor: pointer; user-select: none; white-space: normal; vertical-align: bottom; }
table.sortable th:hover { color: var(--ink); }
table.sortable th[aria-sort="ascending"]::after { content: " ↑"; }
table.sortable th[aria-sort="descending"]::after { content: " ↓"; }
"""

#: A click on a column's head sorts by it, another one the other way round; what is no figure goes last.
SORT = """
for (const head of document.querySelectorAll("table.sortable th")) {
  head.addEventListener("click", () => {
    const table = head.closest("table"), column = head.cellIndex;
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of table.querySelectorAll("th")) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const rows = [...table.rows].slice(1), text = row => row.cells[column].textContent;
    const numeric = head.classList.contains("number");
    const compare = (a, b) => {
      if (!numeric) return (down ? -1 : 1) * text(a).localeCompare(text(b));
      const [x, y] = [parseFloat(text(a)), parseFloat(text(b))];
      if (isNaN(x) || isNaN(y)) return isNaN(x) - isNaN(y);
      return down ? y - x : x - y;
    };
    rows.sort(compare).forEach(row => row.parentNode.append(row));
  });
}
"""


class Page:
    """Collects sections and writes them as one file that needs nothing else.

    Args:
        title: heading.
        about: a line below it.
    """

    def __init__(self, title: str, about: str = ""):
        self.title = title
        self._body = [f"<header><h1>{_text(title)}</h1><p>{_text(about)}</p></header>"]
        self._plots = 0
        self._sorts = False

    def section(self, title: str, about: str = "") -> None:
        """Start a section."""
        self._body.append(f"<h2>{_text(title)}</h2>" + (f"<p>{_text(about)}</p>" if about else ""))

    def text(self, words: str) -> None:
        """A paragraph."""
        self._body.append(f"<p>{_text(words)}</p>")

    def headline(self, figures: Iterable[tuple[str, str]]) -> None:
        """Large figures with what they mean, as (value, words)."""
        cards = "".join(f"<div><b>{_text(value)}</b><span>{_text(words)}</span></div>" for value, words in figures)
        self._body.append(f'<div class="headline">{cards}</div>')

    def table(
        self,
        head: tuple[str, ...],
        rows: Iterable[tuple[str, ...]],
        numbers: tuple[int, ...] = (),
        sortable: bool = False,
    ) -> None:
        """A table; the columns named by `numbers` are right-aligned, and sort by value where a click sorts."""

        def cells(values: tuple[str, ...], tag: str) -> str:
            kinds = (' class="number"' if column in numbers else "" for column in range(len(values)))
            joined = (f"<{tag}{kind}>{_text(value)}</{tag}>" for value, kind in zip(values, kinds, strict=True))
            return f"<tr>{''.join(joined)}</tr>"

        body = "".join(cells(row, "td") for row in rows)
        self._sorts |= sortable
        kind = ' class="sortable"' if sortable else ""
        self._body.append(
            f'<div class="wide"><table{kind}>{cells(head, "th") if any(head) else ""}{body}</table></div>'
        )

    def links(self, head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> None:
        """A table whose rows begin with words and the file beside this one that they lead to, then have other words."""

        def line(words: str, file: str, *others: str) -> str:
            link = f'<a href="{_text(file)}">{_text(words)}</a>'
            return f"<tr><td>{link}</td>{''.join(f'<td>{_text(other)}</td>' for other in others)}</tr>"

        heads = "".join(f"<th>{_text(name)}</th>" for name in head)
        lines = "".join(line(*row) for row in rows)
        self._body.append(f'<div class="wide"><table><tr>{heads}</tr>{lines}</table></div>')

    def settings(self, title: str, content: Mapping[str, object]) -> None:
        """Nested plain data as a table of dotted names."""
        self._body.append(f"<h3>{_text(title)}</h3>")
        self.table(("", ""), list(_flat(content)))

    def columns(self, parts: Mapping[str, Mapping[str, object]]) -> None:
        """Several settings tables side by side, by title."""
        self._body.append('<div class="columns">')
        for title, content in parts.items():
            if content:
                self._body.append("<div>")
                self.settings(title, content)
                self._body.append("</div>")
        self._body.append("</div>")

    def picture(self, figure, caption: str = "") -> None:
        """A matplotlib figure as a transparent PNG; it is closed."""
        import matplotlib.pyplot as plt

        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=130, transparent=True, bbox_inches="tight")
        plt.close(figure)
        data = base64.b64encode(buffer.getvalue()).decode()
        self._body.append(
            f'<figure><img alt="{_text(caption)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{_text(caption)}</figcaption></figure>"
        )

    def plot(self, figure, height: int = 380) -> None:
        """An interactive plotly figure in the page's neutral style."""
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
        self._plots += 1
        self._body.append(
            figure.to_html(
                full_html=False,
                include_plotlyjs=False,
                include_mathjax=False,
                config={"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": ["select2d", "lasso2d"]},
                div_id=f"plot-{self._plots}",
            )
        )

    def write(self, path: Path) -> Path:
        """Write the page.

        Raises:
            InputError: it cannot be written.
        """
        script, last = "", f"<script>{SORT}</script>" if self._sorts else ""
        if self._plots:
            from plotly.offline import get_plotlyjs

            script = f"<script>{get_plotlyjs()}</script>"
        return write_whole(
            path,
            '<!doctype html><html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
            f"<title>{_text(self.title)}</title><style>{STYLE}</style>{script}</head>"
            f"<body><main>{''.join(self._body)}</main>{last}</body></html>\n",
        )


def _text(value: object) -> str:
    return html.escape(str(value))


def _flat(content: Mapping[str, object], prefix: str = "") -> Iterable[tuple[str, str]]:
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        elif isinstance(value, float):
            yield f"{prefix}{name}", f"{value:.6g}"
        elif value not in ("", None):
            yield f"{prefix}{name}", str(value)
