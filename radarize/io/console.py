"""Functions that both command lines share: errors as one sentence, progress bars, tables, and interrupts."""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from types import FrameType
from typing import Annotated, Any

import typer

from radarize import __version__
from radarize.io.errors import DEBUG, InputError, first_line, of_system
from radarize.io.extras import lacking
from radarize.io.files import OUTSIDE

#: Exit code of everything that ends in an error sentence.
FAILED = 2
#: Options of every command, and the environment variables that pass them to its jobs.
_EVERYWHERE = {"--debug": DEBUG, "--allow-outside": OUTSIDE}
#: s between lines of progress where stderr is no terminal.
_PACE = 10.0
#: Longest word, in letters, that a table does not break.
_WORD = 32


def new_app(about: str) -> typer.Typer:
    """Return a command line with the options that every command has."""
    app = typer.Typer(help=about, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)

    @app.callback()
    def options(
        debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
        allow_outside: Annotated[
            bool, typer.Option("--allow-outside", help="Let scenes, maps and data sets name files in other folders.")
        ] = False,
        version: Annotated[
            bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit.")
        ] = False,
    ) -> None:
        del debug, allow_outside, version  # taken from the arguments by `run`, so that they work in any place

    return app


def _print_version(context: typer.Context, wanted: bool) -> None:
    if wanted:
        print(f"{context.info_name} {__version__}")
        raise typer.Exit


def run(app: typer.Typer, name: str, arguments: list[str] | None = None) -> None:
    """Run a command line and exit: 0, or 2 with one sentence on stderr.

    Args:
        app: the commands; name: as the user typed it.
        arguments: arguments; those of the process if None.
    """
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in arguments
    for option, variable in _EVERYWHERE.items():
        if option in arguments:
            os.environ[variable] = "1"  # for jobs on other machines too
    arguments = [argument for argument in arguments if argument not in _EVERYWHERE]
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # SIGTERM acts like Ctrl-C
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="surrogateescape")  # names of files are bytes, which need not be UTF-8
    try:
        _refuse_lost_folder()
        code = typer.main.get_command(app).main(arguments, prog_name=name, standalone_mode=False)
    except (Exception, KeyboardInterrupt) as error:
        if debug:
            raise
        print(f"{name}: {_sentence(error)}", file=sys.stderr)
        code = FAILED
    if code == 130:  # Typer's exit code of an interrupt that no command caught
        print(f"\n{name}: stopped; nothing was written", file=sys.stderr)
        code = FAILED
    sys.exit(code if isinstance(code, int) else 0)


def _refuse_lost_folder() -> None:
    """Refuse a deleted working folder: libraries in C would end the process there without a message.

    Raises:
        InputError: the folder does not exist.
    """
    try:
        os.getcwd()
    except FileNotFoundError:
        raise InputError("the working folder was deleted, expected an existing one: cd to another") from None


def _sentence(error: BaseException) -> str:
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, KeyboardInterrupt):
        return "stopped; nothing was written"
    if hasattr(error, "format_message"):  # the parser's own: a wrong option, a missing argument
        return " ".join(error.format_message().split())
    if isinstance(error, MemoryError) or type(error).__name__ == "OutOfMemoryError":
        return f"not enough memory ({first_line(error)}); a shorter recording or a smaller scene needs less"
    if isinstance(error, OSError):
        return of_system(error)
    if sentence := lacking(error):
        return sentence
    return f"internal error, {type(error).__name__}: {first_line(error)}; --debug shows where"


@contextmanager
def progress(label: str, stopped: str = "") -> Iterator[Callable[..., None]]:
    """Show progress on stderr; call what this yields with (done, total) or (stage, done, total).

    A terminal shows bars, a log gets a line every `_PACE` s.

    Ctrl-C becomes an InputError with the text `stopped`.
    """
    with (_bars if sys.stderr.isatty() else _lines)(label) as move:
        try:
            yield move
        except KeyboardInterrupt:
            raise InputError(f"stopped; {stopped}") if stopped else KeyboardInterrupt from None


@contextmanager
def _bars(label: str) -> Iterator[Callable[..., None]]:
    """Show progress bars, and a spinner until the first call, so that an early error appears without a bar."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
    from rich.progress import TimeRemainingColumn as TimeLeftColumn

    console = Console(stderr=True)
    spinner = console.status(f"{label}: preparing")
    text = TextColumn("{task.description:<20}")
    bars = Progress(text, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeLeftColumn(), console=console)
    tasks: dict[str, TaskID] = {}

    def move(*where: Any) -> None:
        *stage, done, total = where
        name = stage[0] if stage else label
        if not tasks:
            spinner.stop()
            bars.start()
        if name not in tasks:
            tasks[name] = bars.add_task(name, total=None)
        bars.update(tasks[name], completed=done, total=total or None)

    spinner.start()
    try:
        yield move
    finally:
        spinner.stop()
        bars.stop()


@contextmanager
def _lines(label: str) -> Iterator[Callable[..., None]]:
    """Print lines for logs: stage, progress, time so far and time left."""
    start, ended, moved = time.monotonic(), threading.Event(), [""]
    begun: dict[str, tuple[float, float]] = {}  # by stage: start time, and amount done at that time

    def move(*where: Any) -> None:
        *stage, done, total = where
        name, now = (f"{label}, {stage[0]}" if stage else label), time.monotonic()
        since, before = begun.setdefault(name, (now, done))
        share = f" of {total} ({done / total:.0%})" if total else ""
        left = (total - done) * (now - since) / (done - before) if total and done > before else None
        moved[:] = [f"{name}: {done}{share}", f", {_clock(left)} to go" if left is not None else ""]

    def print_progress() -> None:
        while not ended.wait(_PACE):
            what, *left = moved
            sofar = f"{_clock(time.monotonic() - start)} so far"
            print(f"{what or label}, {sofar}{''.join(left)}", file=sys.stderr, flush=True)

    thread = threading.Thread(target=print_progress, daemon=True)
    thread.start()
    try:
        yield move
    finally:
        ended.set()
        thread.join()


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{seconds:02}"


@contextmanager
def working(label: str) -> Iterator[None]:
    """Show a spinner on stderr, or lines, for steps without known progress."""
    if not sys.stderr.isatty():
        with _lines(label):
            yield
        return
    from rich.console import Console

    with Console(stderr=True).status(label):
        yield


def printable(value: object) -> str:
    """Return data as text without control characters for a terminal."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in str(value))


def print_table(head: Sequence[str], rows: Iterable[Sequence[object]], numbers: Collection[int] = ()) -> None:
    """Print a table that is no wider than the terminal; cells are data, never markup.

    Lines break between words; a word of up to `_WORD` letters stays whole, unless there are too many such columns.

    Args:
        head: headings of the columns.
        rows: cells of each row.
        numbers: indices of columns that are right-aligned.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, emoji=False, highlight=False)
    cells = [[printable(value) for value in row] for row in rows]
    table = Table(box=box.SIMPLE_HEAD, header_style="bold", show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
    columns = list(zip(head, *cells, strict=True))
    widths = [min(max(len(word) for cell in column for word in cell.split() or [""]), _WORD) for column in columns]
    # Headings of numeric columns may break; of the others, and of all cells, the longest ones get the remaining width.
    wanted = [max(map(len, column[k in numbers :]), default=0) for k, column in enumerate(columns)]
    room = console.width - 2 * (len(head) - 1)
    while sum(widths) > room and max(widths) > 1:
        widths[widths.index(max(widths))] -= 1
    for _ in range(room - sum(widths)):
        most = max(range(len(head)), key=lambda k: wanted[k] / max(widths[k], 1))
        widths[most] += wanted[most] > widths[most]
    for k, name in enumerate(head):
        table.add_column(name, width=widths[k], justify="right" if k in numbers else "left", overflow="fold")
    for row in cells:
        table.add_row(*row)
    console.print(table)
    console.print()


@contextmanager
def until_interrupted() -> Iterator[threading.Event]:
    """Yield an event that is set by the first Ctrl-C, SIGTERM or the end of the terminal; a second one interrupts as
    usual."""
    asked = threading.Event()
    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

    def note(number: int, frame: FrameType | None) -> None:
        if asked.is_set():
            raise KeyboardInterrupt
        asked.set()

    before = {number: signal.signal(number, note) for number in signals}
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
