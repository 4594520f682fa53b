"""Settings given by hand, for captures whose configuration is lost or wrong."""

from radarize.errors import InputError
from radarize.radar.config import RadarConfig

#: Without these nobody can tell the frames apart.
REQUIRED = ("samples", "loops", "rx")

#: Stand-ins where neither a configuration nor the user says otherwise: a common IWR1843 profile. They do not change
#: the samples, only the scales of range, velocity and time.
ASSUMED: dict[str, object] = {
    "tx_order": (0,),
    "iq_order": "qqii",  # unless the samples say otherwise
    "start_frequency": 77e9,
    "slope": 60e12,
    "sample_rate": 5e6,
    "idle_time": 10e-6,
    "adc_start_time": 6e-6,
}
#: s: the ramp goes on for a moment after the last sample; frames come ten a second, or with half their burst to spare.
_AFTER_ADC = 1e-6
_FRAME_PERIOD = 0.1


def configure(
    config: RadarConfig | None, overrides: dict[str, object], name: str
) -> tuple[RadarConfig, tuple[str, ...]]:
    """The configuration with settings given by hand, and the names of those that had to be assumed.

    Args:
        config: what the capture came with, if anything.
        overrides: fields of `RadarConfig`; ``rx`` and ``tx`` may be counts; None counts as not given.
        name: what errors call it.

    Raises:
        InputError: a value is impossible, or too few are known.
    """
    given = {key: value for key, value in overrides.items() if value is not None}
    for key, most in (("rx", 4), ("tx", 3)):
        if isinstance(count := given.get(key), int) and not 1 <= count <= most:
            raise InputError(f"{name}: {key} is {count}, expected 1 to {most} antennas")
    if isinstance(rx := given.get("rx"), int):
        given["rx"] = tuple(range(rx))
    if (tx := given.pop("tx", None)) is not None:
        given.setdefault("tx_order", tuple(range(tx)) if isinstance(tx, int) else tuple(tx))
    if config is not None:
        return (RadarConfig.build(name, **{**config.model_dump(), **given}) if given else config), ()

    if missing := [key for key in REQUIRED if key not in given]:
        raise InputError(
            f"{name}: has no radar configuration, expected a .cfg or .mmwave.json file, or at least values for "
            f"{', '.join(REQUIRED)} (missing: {', '.join(missing)})"
        )
    fields = {**ASSUMED, **given}
    try:
        adc_end = fields["adc_start_time"] + fields["samples"] / fields["sample_rate"]
        fields.setdefault("ramp_end_time", adc_end + _AFTER_ADC)
        burst = fields["loops"] * len(fields["tx_order"]) * (fields["idle_time"] + fields["ramp_end_time"])
        fields.setdefault("frame_period", max(_FRAME_PERIOD, 1.5 * burst))
    except (TypeError, ZeroDivisionError, OverflowError):
        pass  # the configuration's own checks name the field
    return RadarConfig.build(name, **fields), tuple(key for key in fields if key not in given)
