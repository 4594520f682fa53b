"""Where odometry of a run was blind, as the run tells itself."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field, ValidationError

from radarize.errors import InputError

Amount = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Span(BaseModel):
    """From when to when, s; the way meanwhile, m; why."""

    start_s: Amount
    stop_s: Amount
    way_m: Amount
    why: str


class BlindSpans(BaseModel):
    """All spans, with their way, m, and its share of the whole way."""

    share_of_way: Amount
    way_m: Amount
    spans: list[Span]

    @classmethod
    def of(cls, facts: Mapping[str, object], path: Path, start: float) -> "BlindSpans | None":
        """What ``run.json`` says; None where it does not, as runs of old.

        Args:
            facts: content of the file.
            path: of the file, for errors.
            start: stamp that the spans are counted from, s.

        Raises:
            InputError: it says something else.
        """
        if "blind" not in facts:
            return None
        try:
            found = cls.model_validate(facts["blind"])
        except ValidationError as error:
            problem = error.errors()[0]
            field = ".".join(map(str, ("blind", *problem["loc"])))
            raise InputError(f"{path}: {field} is {str(problem['input'])[:60]!r}: {problem['msg'].lower()}") from error
        for span in found.spans:
            span.start_s, span.stop_s = span.start_s - start, span.stop_s - start
        return found
