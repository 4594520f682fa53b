"""Where odometry of a run was blind, as the run tells itself."""

from typing import Annotated

from pydantic import BaseModel, Field, ValidationError

from radarize.errors import InputError
from radarize.plain import complaint
from radarize.runfolder import RunFolder

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
    def of(cls, run: RunFolder) -> "BlindSpans | None":
        """What ``run.json`` says, in s since the first pose; None where it does not, as runs of old.

        Raises:
            InputError: it says something else.
        """
        if "blind" not in run.facts:
            return None
        try:
            found = cls.model_validate(run.facts["blind"])
        except ValidationError as error:
            raise InputError(f"{run.path / 'run.json'}: blind.{complaint(error)}") from error
        start = float(run.trajectory[0][0])
        for span in found.spans:
            span.start_s, span.stop_s = span.start_s - start, span.stop_s - start
        return found
