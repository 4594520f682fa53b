"""Check a recording: the faults that its samples show."""

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
    """What a check found.

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
        """Nothing was found."""
        return not self.findings

    def warnings(self) -> list[str]:
        """A sentence on each finding."""
        return [str(each) for each in self.findings]

    def to_json(self) -> str:
        """All of it as JSON."""
        found = {
            "well": self.well, "findings": [each.row() for each in self.findings], "not_observable": self.not_observable
        }  # fmt: skip
        return json.dumps(found, indent=2)

    def __str__(self) -> str:
        told = self.warnings() or ["no fault found"]
        return "\n".join([*told, *(f"not observable: {kind}: {why}" for kind, why in self.not_observable.items())])


def check(recording: Source, fix: str | Path | None = None) -> Check:
    """Find what is wrong with a recording, from the samples of a walk.

    In a static world, Doppler, range and the phases over antennas and chirps are bound to each other. So ten seconds of
    a moving radar show whether I and Q, transmitters, receivers, chirps, frames and stamps are what the configuration
    says. What cannot be seen, such as left and right without an IMU or true poses, is listed with the reason.

    Args:
        recording: a recording or a file, or frames of one such as ``rec[:300]``.
        fix: recording to write (``.h5``) in which all is mended that reordering, exchange or another configuration
            mends; a board's file (``.yaml``) if that is what is wrong.

    Returns:
        ``.findings`` (kind, what was measured, how sure, remedy), ``.not_observable`` (why by kind), ``.well``.

    Raises:
        InputError: an unusable recording, one without samples, or nothing to be mended with `fix`.

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
        from radarize.pipeline.check.mending import write_mended

        write_mended(frames, found.findings, Path(fix))
    return found


def warnings_before(frames: Clip) -> list[str]:
    """A sentence on each fault that some frames of a recording show, for those who are about to use it.

    Asked again of the same open recording, it is not checked again.
    """
    return [*map(str, _looked_at(frames).findings)]


def warnings_after(frames: Clip, sequence: Sequence) -> list[str]:
    """The same of faults that only all frames together show.

    Args:
        frames: as before.
        sequence: of all frames of their span, by who has read them anyway.
    """
    evidence = Evidence.of(frames.recording[frames.span.start : frames.span.stop])
    evidence.sequence = sequence
    before = _looked_at(frames).findings
    found = check_evidence(evidence, [test for test in TESTS if test.whole], before)
    return [*map(str, found.findings[len(before) :])]


def _looked_at(frames: Clip) -> "Check":
    recording, span = frames.recording, frames.span
    if not recording.has_samples or not len(frames):
        return Check((), {})
    known = _CHECKED.setdefault(recording, {})
    if span not in known:
        evidence = Evidence.of(recording[span.start : span.stop])
        evidence.places = _PLACES
        known[span] = check_evidence(evidence, [test for test in TESTS if not test.whole])
    return known[span]


#: At which frames are looked at closely before a run: half of those of a check, in half its time.
_PLACES = PLACES // 2
#: What was found in open recordings, by the span of frames.
_CHECKED: WeakKeyDictionary[Recording, dict[range, Check]] = WeakKeyDictionary()


def check_evidence(evidence: Evidence, tests: Iterable[Test] = TESTS, before: tuple[Finding, ...] = ()) -> Check:
    """Tests on evidence.

    What hides others is mended for the tests that follow; if it cannot be, these are not made.

    Args:
        tests: in their order.
        before: what others found; mended in the evidence or not.
    """
    findings, unseen = [*before], {}
    blocked = next((each.kind for each in before if each.hides and each.mending is None), "")
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
            if each.mending is not None:
                evidence = evidence.mended(each.mending)
            elif each.hides:
                blocked = each.kind
    return Check(tuple(findings), unseen)
