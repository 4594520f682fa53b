"""mmWave Studio settings: ``NAME.mmwave.json`` (the radar) and ``NAME.setup.json`` (device, files of a capture).

Field names: mmWave Studio user's guide and the mmWaveLink ICD; numbers come as JSON numbers or as hexadecimal strings.
"""

from decimal import Decimal
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.jsonfile import parse_json
from radarize.radar.boards import likely_board, named_board
from radarize.radar.cfg import distinct_order, firing_of, numbers, read_text
from radarize.radar.config import HIGH_PASS_1, HIGH_PASS_2, Firing, RadarConfig, fired


def load_studio(path: Path, setup: Path | None = None) -> tuple[RadarConfig, str]:
    """Load configuration and text of a ``.mmwave.json`` file.

    Args:
        path: the settings.
        setup: ``.setup.json`` with the device; default: the one beside `path`, if there is exactly one.

    Raises:
        InputError: a file is unreadable, or a setting is missing or not covered.
    """
    if setup is None:
        beside = sorted(path.parent.glob("*.setup.json"))
        setup = beside[0] if len(beside) == 1 else None
    device = str(load_json(setup).get("mmWaveDevice", "")) if setup else ""
    text = read_text(path)
    return parse_studio(text, name=str(path), device=device), text


def load_json(path: Path) -> dict:
    """Read a JSON object from a file, with fractions as exact decimals.

    Raises:
        InputError: unreadable, or not a JSON object.
    """
    return parse_json(read_text(path), str(path), Decimal)


def parse_studio(text: str, name: str = "mmwave.json", device: str = "") -> RadarConfig:
    """Read mmWave Studio settings of one chirp profile.

    Args:
        text: content of a ``.mmwave.json`` file.
        name: name in error messages, usually the path.
        device: ``mmWaveDevice`` of the setup file, e.g. ``iwr6843``; determines the board together with the band.

    Raises:
        InputError: names the file and field.
    """
    devices = _Node(name, "", parse_json(text, name, Decimal)).items("mmWaveDevices")
    if len(devices) != 1:
        raise InputError(f"{name}: mmWaveDevices has {len(devices)} entries, expected one device")
    rf, capture = devices[0].node("rfConfig"), devices[0].node("rawDataCaptureConfig")
    if (waveform := rf.get("waveformType")) != "legacyFrameChirp":
        raise rf.error("waveformType", waveform, "legacyFrameChirp (plain frames)")
    output = rf.node("rlAdcOutCfg_t").node("fmt")
    output.require("b2AdcBits", (2,), "16 bit")
    real = not output.require("b2AdcOutFmt", (0, 1), "real or complex 1x samples")
    data_format = capture.node("rlDevDataFmtCfg_t")
    swap = data_format.require("iqSwapSel", (0, 1), "0 = I first, 1 = Q first")
    data_format.require("chInterleave", (1,), "receivers one after another")
    capture.node("rlDevDataPathCfg_t").require("transferFmtPkt0", (1,), "ADC samples alone")
    capture.node("rlDevLaneEnable_t").require("laneEn", (3,), "two LVDS lanes")

    channels, frame = rf.node("rlChanCfg_t"), rf.node("rlFrameCfg_t")
    rx_mask = channels.integer("rxChannelEn")
    order, profile = _firing(rf, frame)
    tx_order, repeats = distinct_order(order, f"{name}: rlFrameCfg_t")
    start_frequency = profile.decimal("startFreqConst_GHz", 9)
    return RadarConfig.build(
        name,
        board=named_board(device) or likely_board(start_frequency),
        start_frequency=start_frequency,
        slope=profile.decimal("freqSlopeConst_MHz_usec", 12),
        idle_time=profile.decimal("idleTimeConst_usec", -6),
        adc_start_time=profile.decimal("adcStartTimeConst_usec", -6),
        ramp_end_time=profile.decimal("rampEndTime_usec", -6),
        samples=profile.integer("numAdcSamples") // (2 if real else 1),
        sample_rate=profile.decimal("digOutSampleRate", 3) / (2 if real else 1),
        loops=frame.integer("numLoops") * repeats,
        frame_period=frame.decimal("framePeriodicity_msec", -3),
        tx_order=tx_order,
        rx=numbers(rx_mask),
        rx_gain_db=profile.integer("rxGain_dB") & 0x3F,
        tx_backoff_db=profile.integer("txOutPowerBackoffCode") >> 8 * fired(tx_order[0])[0] & 0xFF,
        high_pass=(
            HIGH_PASS_1[profile.require("hpfCornerFreq1", (0, 1, 2, 3), "a corner code")],
            HIGH_PASS_2[profile.require("hpfCornerFreq2", (0, 1, 2, 3), "a corner code")],
        ),
        iq_order="real" if real else "qqii" if swap else "iiqq",
    )


def _firing(rf: "_Node", frame: "_Node") -> tuple[tuple[Firing, ...], "_Node"]:
    """Transmitters of one pass through the frame's chirps, and the profile they use."""
    profiles = [p.node("rlProfileCfg_t") for p in rf.items("rlProfiles")]
    chirps = [c.node("rlChirpCfg_t") for c in rf.items("rlChirps")]
    order: list[Firing] = []
    used: set[int] = set()
    first, end = frame.integer("chirpStartIdx"), frame.integer("chirpEndIdx")
    for index in range(first, min(end, 511) + 1):
        matching = [c for c in chirps if c.integer("chirpStartIdx") <= index <= c.integer("chirpEndIdx")]
        if not matching:
            raise frame.error("chirpEndIdx", end, f"settings in rlChirps for every chirp; chirp {index} has none")
        chirp = matching[-1]
        for field in ("startFreqVar_MHz", "freqSlopeVar_KHz_usec", "idleTimeVar_usec", "adcStartTimeVar_usec"):
            if chirp.decimal(field) != 0:
                raise chirp.error(field, chirp.get(field), "0 (the same for all chirps)")
        if not (mask := chirp.integer("txEnable")):
            raise chirp.error("txEnable", 0, "a transmitter at least")
        order.append(firing_of(mask))
        used.add(chirp.integer("profileId"))
    matching = [p for p in profiles if p.integer("profileId") in used]
    if len(used) != 1 or not matching:
        raise frame.error("chirpEndIdx", end, f"chirps of one defined profile, found profiles {sorted(used)}")
    return tuple(order), matching[-1]


class _Node:
    """JSON object with its path, for error messages."""

    def __init__(self, file: str, path: str, data: object):
        if not isinstance(data, dict):
            raise InputError(f"{file}: {path or 'the file'} is {str(data)[:40]!r}, expected an object")
        self.file, self.path, self.data = file, path, data

    def error(self, field: str, value: object, expected: str) -> InputError:
        return InputError(f"{self.file}: {self.path}.{field} is {str(value)[:40]}, expected {expected}")

    def get(self, field: str) -> object:
        if field not in self.data:
            raise InputError(f"{self.file}: has no {self.path}.{field}")
        return self.data[field]

    def node(self, field: str) -> "_Node":
        return _Node(self.file, f"{self.path}.{field}".lstrip("."), self.get(field))

    def items(self, field: str) -> list["_Node"]:
        """Entries of a list; a single entry may appear without a list, as some programs write it."""
        value = self.get(field)
        if isinstance(value, dict) and value:
            return [self.node(field)]
        if not isinstance(value, list) or not value:
            raise self.error(field, value, "a list with at least one entry")
        return [_Node(self.file, f"{self.path}.{field}[{i}]".lstrip("."), item) for i, item in enumerate(value)]

    def decimal(self, field: str, unit: int = 0) -> float:
        value = self.get(field)
        if isinstance(value, bool) or not isinstance(value, int | Decimal) or not abs(Decimal(value)) < 10**30:
            raise self.error(field, value, "a number")
        return float(Decimal(value).scaleb(unit))

    def integer(self, field: str) -> int:
        value = self.get(field)
        try:
            if not isinstance(value, str | int | Decimal):
                raise ValueError
            number = int(value, 0) if isinstance(value, str) else int(value)
        except (ValueError, OverflowError):
            raise self.error(field, value, "a whole number") from None
        if isinstance(value, Decimal) and number != value or not 0 <= number < 2**32:
            raise self.error(field, value, "a whole number of at least 0")
        return number

    def require(self, field: str, allowed: tuple[int, ...], meaning: str) -> int:
        value = self.integer(field)
        if value not in allowed:
            raise self.error(field, value, f"{' or '.join(map(str, allowed))} ({meaning})")
        return value
