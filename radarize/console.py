"""What both command lines share: errors as one sentence, progress bars, and how a command is stopped."""

import errno
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from radarize.errors import InputError

#: Exit code of everything that ends in an error sentence.
FAILED = 2


def new_app(about: str) -> typer.Typer:
    """A command line with the options that every command takes."""
    app = typer.Typer(help=about, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)

    @app.callback()
    def options(debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False):
        del debug  # taken from the arguments by `run`, so that it works in any place

    return app


def run(app: typer.Typer, name: str, arguments: list[str] | None = None) -> None:
    """Run a command line and exit: 0, or 2 with one sentence on stderr.

    Args:
        app: its commands.
        name: as the user typed it.
        arguments: the process's own if None.
    """
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in arguments
    arguments = [argument for argument in arguments if argument != "--debug"]
    try:
        code = typer.main.get_command(app).main(arguments, prog_name=name, standalone_mode=False)
    except (Exception, KeyboardInterrupt) as error:
        if debug:
            raise
        print(f"{name}: {_sentence(error)}", file=sys.stderr)
        code = FAILED
    if code == 130:  # how Typer hands on an interrupt that no command caught
        print(f"\n{name}: stopped; nothing was written", file=sys.stderr)
        code = FAILED
    sys.exit(code if isinstance(code, int) else 0)


def _sentence(error: BaseException) -> str:
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, KeyboardInterrupt):
        return "stopped; nothing was written"
    if hasattr(error, "format_message"):  # the parser's own: a wrong option, a missing argument
        return " ".join(error.format_message().split())
    if isinstance(error, MemoryError) or type(error).__name__ == "OutOfMemoryError":
        return f"not enough memory ({_first_line(error)}); a shorter recording or a smaller scene needs less"
    if isinstance(error, OSError):
        reason = "no space left on the device" if error.errno == errno.ENOSPC else error.strerror or _first_line(error)
        return f"{error.filename}: {reason}" if error.filename else reason
    return f"internal error, {type(error).__name__}: {_first_line(error)}; --debug shows where"


def _first_line(error: BaseException) -> str:
    return str(error).strip().split("\n", 1)[0] or type(error).__name__


@contextmanager
def progress(label: str) -> Iterator[Callable[..., None]]:
    """Progress bars on stderr, moved by calling what this yields with (done, in all) or (stage, done, in all).

    Until the first call, while things are being prepared, a spinner turns; so an error then comes without a bar.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.progress import TimeRemainingColumn as TimeLeftColumn

    console = Console(stderr=True)
    spinner = console.status(f"{label}: preparing")
    text = TextColumn("{task.description:<20}")
    bars = Progress(text, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeLeftColumn(), console=console)
    tasks: dict[str, int] = {}

    def move(*where) -> None:
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
def working(label: str) -> Iterator[None]:
    """A spinner on stderr for steps that cannot say how far they are."""
    from rich.console import Console

    with Console(stderr=True).status(label):
        yield


@contextmanager
def until_interrupted() -> Iterator[threading.Event]:
    """An event that the first Ctrl-C, or a request to terminate, sets; a second one interrupts as usual."""
    asked = threading.Event()
    signals = (signal.SIGINT, signal.SIGTERM)

    def note(number, frame) -> None:
        if asked.is_set():
            raise KeyboardInterrupt
        asked.set()

    before = {number: signal.signal(number, note) for number in signals}
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
