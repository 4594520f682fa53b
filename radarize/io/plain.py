"""Plain data classes with validation, and validation errors as sentences."""

from reprlib import repr as shortened
from typing import Any

from pydantic import ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from radarize.io.schema import Described

#: Upper limit of any numeric setting, in its unit.
MOST = 1_000_000


class Frozen(Described):
    """Immutable model that accepts no unknown field."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def setting(default: object, about: str, unit: str = "", *, tuned: str = "", **limits: Any) -> Any:
    """Return a field of a configuration.

    Numbers without an upper limit of their own have `MOST`: what is computed from them stays finite.

    Args:
        default: value.
        about: what it is.
        unit: of the number, "1" if it has none; "" of what is no number.
        tuned: recordings on which the default was chosen; names in capitals are sets of
            ``radarize/evaluation/benchmark/choices.yaml``.
        limits: as of pydantic's `Field`.
    """
    if isinstance(default, int | float) and not isinstance(default, bool) and not limits.keys() & {"le", "lt"}:
        limits["le"] = MOST
    return Field(default, description=about, json_schema_extra={"unit": unit, "tuned": tuned}, **limits)


def unit_of(field: FieldInfo) -> str:
    """Return the unit of a `setting`, "1" for a number without one."""
    return _extra(field, "unit")


def tuned_on(field: FieldInfo) -> str:
    """Return the recordings on which the default of a `setting` was chosen, or ""."""
    return _extra(field, "tuned")


def _extra(field: FieldInfo, name: str) -> str:
    extra = field.json_schema_extra
    return str(extra.get(name, "")) if isinstance(extra, dict) else ""


def format_validation_error(error: ValidationError) -> str:
    """Return the first error as text: field, value, and what is expected."""
    first = error.errors()[0]
    field = ".".join(map(str, first["loc"])) or "file"
    if first["type"] == "missing":
        return f"has no {field}"
    return f"{field} is {shortened(first['input'])}, expected: {first['msg']}"
