"""Check a recording for faults that its samples show."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from weakref import WeakKeyDictionary

from radarize.io.errors import InputError
from radarize.io.load import Source, frames_of
from radarize.io.recording import Clip, Recording
from radarize.pipeline.check.evidence import PLACES, Evidence
from radarize.pipeline.check.faults import TESTS, Test
from radarize.pipeline.check.finding import Finding, NotObservable
from radarize.pipeline.check.summary import Sequence


@dataclass(frozen=True)
class Check:
    """Result of a check.

    Attributes:
        findings: faults, in the order of the tests.
        not_observable: kinds of faults that the recording would not show, and why.

    Example:
        >>> found = rz.check(rec)
        >>> found.well, found.warnings()
        (True, [])
    """

    findings: tuple[Finding, ...]
    not_observable: dict[str, str]

    @property
    def well(self) -> bool:
        """Whether no fault was found."""
        return not self.findings

    def warnings(self) -> list[str]:
        """Return a sentence on each finding."""
        return [str(each) for each in self.findings]

    def to_json(self) -> str:
        """Return the result as JSON."""
        found = {
            "well": self.well, "findings": [each.row() for each in self.findings], "not_observable": self.not_observable
        }  # fmt: skip
        return json.dumps(found, indent=2)

    def __str__(self) -> str:
        lines = self.warnings() or ["no fault found"]
        return "\n".join([*lines, *(f"not observable: {kind}: {why}" for kind, why in self.not_observable.items())])


def check(recording: Source, fix: str | Path | None = None) -> Check:
    """Find faults of a recording from the samples of a walk.

    In a static world, Doppler, range and the phases over antennas and chirps depend on each other. Ten seconds of a
    moving radar therefore show whether I and Q, transmitters, receivers, chirps, frames and time stamps agree with the
    configuration. What is not observable, such as left and right without an IMU or true poses, is listed with the
    reason.

    Args:
        recording: a recording or a file, or frames of one such as ``rec[:300]``.
        fix: recording to write (``.h5``) in which everything is corrected that reordering, exchange or another
            configuration corrects; or a board file (``.yaml``) if the board is wrong.

    Returns:
        ``.findings`` (kind, measurement, confidence, remedy), ``.not_observable`` (reason by kind), ``.well``.

    Raises:
        InputError: an unusable recording, one without samples, or `fix` is given and nothing can be corrected.

    Example:
        >>> rz.check(rec).well
        True
    """
    frames = frames_of(recording)
    if not frames.recording.has_samples:
        raise InputError(f"{frames.recording.path}: has no raw samples, expected a recording with /radar/adc")
    if not len(frames):
        raise InputError(f"{frames.recording.path}: has no whole frame, expected at least one")
    found = check_evidence(Evidence.of(frames))
    if fix is not None:
        from radarize.pipeline.check.correction import write_corrected

        write_corrected(frames, found.findings, Path(fix))
    return found


def warnings_before(frames: Clip) -> list[str]:
    """Return a sentence on each fault that some frames of a recording show, before it is used.

    The result is cached for an open recording.
    """
    return [*map(str, _checked(frames).findings)]


def warnings_after(frames: Clip, sequence: Sequence) -> list[str]:
    """Return a sentence on each fault that only all frames together show.

    Args:
        frames: as in `warnings_before`.
        sequence: summary of all frames of their span, from reading them.
    """
    evidence = Evidence.of(frames.recording[frames.span.start : frames.span.stop])
    evidence.sequence = sequence
    before = _checked(frames).findings
    found = check_evidence(evidence, [test for test in TESTS if test.whole], before)
    return [*map(str, found.findings[len(before) :])]


def _checked(frames: Clip) -> "Check":
    recording, span = frames.recording, frames.span
    if not recording.has_samples or not len(frames):
        return Check((), {})
    known = _CHECKED.setdefault(recording, {})
    if span not in known:
        evidence = Evidence.of(recording[span.start : span.stop])
        evidence.places = _PLACES
        known[span] = check_evidence(evidence, [test for test in TESTS if not test.whole])
    return known[span]


#: Number of places that are examined before a run: half of those of a check, in half the time.
_PLACES = PLACES // 2
#: Results for open recordings, by the span of frames.
_CHECKED: WeakKeyDictionary[Recording, dict[range, Check]] = WeakKeyDictionary()


def check_evidence(evidence: Evidence, tests: Iterable[Test] = TESTS, before: tuple[Finding, ...] = ()) -> Check:
    """Run tests on evidence.

    A fault that hides others is corrected for the tests that follow; if it cannot be, these are skipped.

    Args:
        tests: tests in order.
        before: findings of earlier tests, corrected in the evidence or not.
    """
    findings, unseen = [*before], {}
    blocked = next((each.kind for each in before if each.hides and each.correction is None), "")
    for test in tests:
        hidden = blocked or ", ".join(each.kind for each in findings if each.kind in test.unless)
        if hidden:
            unseen.update(dict.fromkeys(test.kinds, f"hidden by: {hidden}"))
            continue
        try:
            found = list(test.find(evidence))
        except NotObservable as reason:
            unseen.update(dict.fromkeys(test.kinds, str(reason)))
            continue
        findings += found
        for each in found:
            if each.correction is not None:
                evidence = evidence.corrected(each.correction)
            elif each.hides:
                blocked = each.kind
    return Check(tuple(findings), unseen)
