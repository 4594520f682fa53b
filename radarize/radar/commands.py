"""Commands of TI's configuration files (``.cfg``), with values read by name.

Command syntax: mmWave SDK 3.x user's guide, section "Configuration (.cfg) file format"; MMWAVE-L-SDK for low-power
chips. Commands that concern only the on-chip processing (CFAR, angle of arrival, tracking, ...) are ignored.
"""

import difflib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

from radarize.io.errors import InputError

#: Fields of the commands that are read, in order.
FIELDS: dict[str, tuple[str, ...]] = {
    "dfeDataOutputMode": ("mode",),
    "channelCfg": ("rxChannelEn", "txChannelEn", "cascading"),
    "adcCfg": ("numADCBits", "adcOutputFmt"),
    "adcbufCfg": ("subFrameIdx", "adcOutputFmt", "SampleSwap", "ChanInterleave", "ChirpThreshold"),
    "profileCfg": tuple(
        "profileId startFreq idleTime adcStartTime rampEndTime txOutPower txPhaseShifter freqSlopeConst txStartTime "
        "numAdcSamples digOutSampleRate hpfCornerFreq1 hpfCornerFreq2 rxGain".split()
    ),
    "chirpCfg": tuple(
        "startIdx endIdx profileId startFreqVar freqSlopeVar idleTimeVar adcStartTimeVar txEnable".split()
    ),
    "frameCfg": tuple("startIdx endIdx numLoops numFrames framePeriodicity triggerSelect frameTriggerDelay".split()),
    "advFrameCfg": tuple("numOfSubFrames forceProfile numFrames triggerSelect frameTrigDelay".split()),
    "subFrameCfg": tuple(
        "subFrameNum forceProfileIdx chirpStartIdx numOfChirps numLoops burstPeriodicity chirpStartIdxOffset "
        "numOfBurst numOfBurstLoops subFramePeriodicity".split()
    ),
    "bpmCfg": ("subFrameIdx", "isEnabled", "chirp0Idx", "chirp1Idx"),
    "lvdsStreamCfg": ("subFrameIdx", "enableHeader", "dataFmt", "enableSW"),
    "compRangeBiasAndRxChanPhase": ("rangeBias", *(f"{p}{i}" for i in range(12) for p in ("re", "im"))),
    "antPhaseRot": tuple(f"rotation{i}" for i in range(12)),
    # Low power.
    "chirpComnCfg": tuple(
        "digOutputSampRate digOutputBitsSel dfeFirSel numOfAdcSamples chirpTxMimoPatSel chirpRampEndTime "
        "chirpRxHpfSel".split()
    ),
    "chirpTimingCfg": tuple(
        "chirpIdleTime chirpAdcSkipSamples chirpTxStartTime chirpRfFreqSlope chirpRfFreqStart".split()
    ),
    "factoryCalibCfg": ("saveEnable", "restoreEnable", "rxGain", "backoff0", "flashOffset"),
    "antGeometryBoard": ("board",),
}
#: Other forms of a command, distinguished by the number of values: of low-power chips, and of the AWR294x.
_BURSTS = "numOfChirpsInBurst numOfChirpsAccum burstPeriodicity numOfBurstsInFrame framePeriodicity numOfFrames"
_AWR294X = "startIdx endIdx numLoops numFrames numAdcSamples framePeriodicity triggerSelect frameTriggerDelay"
OTHER_FORMS = {"frameCfg": (tuple(_BURSTS.split()), tuple(_AWR294X.split()))}
REFUSED = {"contModeCfg": "continuous mode"}


@dataclass(frozen=True)
class Command:
    """One line of a configuration, with values by field name and line numbers in errors."""

    file: str
    line: int
    name: str
    fields: tuple[str, ...]
    values: tuple[str, ...]

    def error(self, field: str, expected: str) -> InputError:
        value = self.values[self.fields.index(field)]
        return InputError(f"{self.file}, line {self.line}: {self.name} {field} is {value}, expected {expected}")

    def decimal(self, field: str, unit: int = 0) -> float:
        """A number in units of 10^unit, exact: 122 with unit -6 is the float nearest to 0.000122."""
        try:
            value = Decimal(self.values[self.fields.index(field)])
        except InvalidOperation:
            raise self.error(field, "a number") from None
        if not value.is_finite() or abs(value) > Decimal("1e30"):
            raise self.error(field, "a finite number")
        return float(value.scaleb(unit))

    def integer(self, field: str, low: int = 0, high: int = 2**32 - 1) -> int:
        value = self.decimal(field)
        if value != int(value) or not low <= value <= high:
            raise self.error(field, f"a whole number from {low} to {high}")
        return int(value)

    def require(self, field: str, allowed: tuple[int, ...], meaning: str) -> int:
        value = self.integer(field, low=-(2**31))
        if value not in allowed:
            raise self.error(field, f"{' or '.join(map(str, allowed))} ({meaning})")
        return value


def commands_of(text: str, name: str) -> Iterator[Command]:
    """Parse the commands of a configuration; `name` is its name in error messages.

    Raises:
        InputError: a line that is no command, has a wrong number of values, or is misspelt.
    """
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("%")[0].split()
        if not words:
            continue
        word = words[0]
        if not re.fullmatch(r"[A-Za-z]\w*", word):
            raise InputError(f"{name}, line {number}: starts with {word[:40]!r}, expected a command such as profileCfg")
        if word in REFUSED:
            raise InputError(
                f"{name}, line {number}: {word} asks for {REFUSED[word]}, expected plain frames (frameCfg)"
            )
        if word in FIELDS:
            if (fields := _form(word, len(words) - 1)) is None:
                expected = FIELDS[word]
                raise InputError(
                    f"{name}, line {number}: {word} has {len(words) - 1} values, expected {len(expected)} "
                    f"({', '.join(expected[:14])}{', ...' if len(expected) > 14 else ''})"
                )
            yield Command(name, number, word, fields, tuple(words[1:]))
        elif close := difflib.get_close_matches(word, FIELDS, 1, cutoff=0.85):
            raise InputError(f"{name}, line {number}: unknown command {word}, expected {close[0]}")


def _form(word: str, count: int) -> tuple[str, ...] | None:
    """Fields of a command with a number of values."""
    if word == "compRangeBiasAndRxChanPhase" and count > 1 and count % 2:  # a pair for each of the board's channels
        return "rangeBias", *(f"{part}{i}" for i in range(count // 2) for part in ("re", "im"))
    if word == "antPhaseRot" and count:
        return tuple(f"rotation{i}" for i in range(count))
    return next((form for form in (FIELDS[word], *OTHER_FORMS.get(word, ())) if len(form) == count), None)
