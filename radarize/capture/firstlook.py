"""Check of the first seconds of a stream, in parallel to the pipeline."""

from concurrent.futures import Future, ThreadPoolExecutor, wait

import numpy as np
from jaxtyping import Bool, Float, Int16

from radarize.io.errors import first_line
from radarize.pipeline.check.check import check_evidence
from radarize.pipeline.check.evidence import Evidence
from radarize.radar.config import RadarConfig

#: Duration of the frames that are checked, s, and their largest memory, bytes.
_LASTS, _MOST = 5.0, 128 << 20


class FirstLook:
    """Collect the first frames of a stream and check them in a thread.

    Args:
        config: radar configuration.
    """

    def __init__(self, config: RadarConfig):
        self._config = config
        self._wanted = max(min(round(_LASTS / config.frame_period), _MOST // config.frame_bytes), 1)
        self._kept: list[tuple[np.ndarray, ...]] = []
        self._found: Future[list[str]] | None = None

    def add(
        self,
        adc: Int16[np.ndarray, "frame loop tx rx sample 2"],
        times: Float[np.ndarray, "frame"],
        valid: Bool[np.ndarray, "frame loop tx"],
    ) -> None:
        """Add the next frames."""
        if self._found is not None:
            return
        self._kept.append((adc.copy(), times.copy(), valid.copy()))
        if sum(len(each[1]) for each in self._kept) >= self._wanted:
            self._begin()

    def finish(self) -> None:
        """Check the frames received, if the stream ends early, and wait for the result."""
        if self._found is None and self._kept:
            self._begin()
        if self._found is not None:
            wait([self._found])

    def _begin(self) -> None:
        frames, self._kept = self._kept, []
        worker = ThreadPoolExecutor(1, thread_name_prefix="check")
        self._found = worker.submit(self._check, frames)
        worker.shutdown(wait=False)

    def _check(self, kept: list[tuple[np.ndarray, ...]]) -> list[str]:
        adc, times, valid = map(np.concatenate, zip(*kept, strict=True))
        evidence = Evidence(self._config, times, valid, lambda start, stop: adc[start:stop])
        return check_evidence(evidence).warnings()

    def warnings(self) -> list[str]:
        """A sentence on each fault that was found; empty until the check is finished."""
        if self._found is None or not self._found.done():
            return []
        if (error := self._found.exception()) is not None:
            return [f"the first seconds could not be checked ({first_line(error)})"]
        return self._found.result()
