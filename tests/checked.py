"""Shapes and kinds of arrays, as annotations have them, checked while tests run: in the first calls that a test makes
of each function, and in some of the many that loops make later.

Whatever else is annotated is duck-typed: tests put simpler things in its place. Compiled kernels have no annotations of
arrays, and numba takes them as they are.
"""

import dataclasses
from collections import Counter
from collections.abc import Callable
from functools import wraps
from inspect import isclass
from types import UnionType
from typing import Union, get_args, get_origin

import jaxtyping
from beartype import beartype
from jaxtyping import AbstractArray, install_import_hook

#: Calls of a function in a test that are all checked, and of how many later ones one is: a check takes longer than most
#: functions that are called more often.
FIRST, ONE_OF = 10, 20
_calls: Counter[Callable] = Counter()


def install() -> None:
    """Check array shapes and kinds in all modules of both packages imported from now on."""
    plain = jaxtyping.jaxtyped

    def only_arrays(typechecker):
        def decorate(thing: type | Callable) -> type | Callable:
            if not _takes_arrays(thing):
                return thing
            if isclass(thing):
                thing.__init__ = decorate(thing.__init__)
                return thing
            return _sampled(plain(thing, typechecker=typechecker), thing)

        return decorate

    jaxtyping.jaxtyped = only_arrays  # which the hook puts on everything: half of the back end's time went into that
    install_import_hook(["radarize", "radarsim"], "tests.checked.arrays")


def begin_test() -> None:
    """Reset the call counts, so that the checks in a test do not depend on earlier tests."""
    _calls.clear()


def arrays(function: Callable) -> Callable:
    """Wrap a function so that its arrays are checked."""
    hints = dict(function.__annotations__)
    function.__annotations__ = {name: hint for name, hint in hints.items() if _has_array(hint)}
    if not function.__annotations__:
        function.__annotations__ = hints
        return function
    found = beartype(function)
    found.__annotations__ = hints
    return found


def _sampled(checked: Callable, function: Callable) -> Callable:
    """Call the checked function in some calls, and the function itself in the others."""

    @wraps(function)
    def either(*args, **options):
        call = _calls[function]
        _calls[function] = call + 1
        return (checked if call < FIRST or call % ONE_OF == 0 else function)(*args, **options)

    return either


def _takes_arrays(thing: type | Callable) -> bool:
    """Whether a data class or function has array annotations."""
    if isclass(thing):
        return dataclasses.is_dataclass(thing) and _takes_arrays(thing.__init__)
    return any(map(_has_array, thing.__annotations__.values()))


def _has_array(hint: object) -> bool:
    """Whether an annotation is an array, or contains arrays; those in a list or mapping may have any shapes."""
    if get_origin(hint) in (tuple, Union, UnionType):
        return any(map(_has_array, get_args(hint)))
    return isinstance(hint, type) and issubclass(hint, AbstractArray)
