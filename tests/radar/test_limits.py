import pytest

from radarize.io.errors import InputError
from radarize.radar.limits import check_limits
from radarize.radar.presets import PRESETS, load_config

BASE = PRESETS["radarize"]


@pytest.mark.parametrize("name", PRESETS)
def test_presets_are_possible(name):
    check_limits(PRESETS[name])


def test_public_files_are_possible(recordings):
    for path in recordings.rglob("*.cfg"):
        check_limits(load_config(path)[0])


def test_the_60_ghz_chip_has_its_own_band():
    chip = BASE.model_copy(update={"board": "iwr6843isk", "start_frequency": 60e9})
    check_limits(chip)
    with pytest.raises(InputError, match="60-64 GHz"):
        check_limits(BASE.model_copy(update={"board": "iwr6843aop"}))


@pytest.mark.parametrize(
    "change, message",
    [
        ({"start_frequency": 76e9}, "76-78 GHz or 77-81 GHz"),  # 76-80 GHz: across both bands
        ({"start_frequency": 75.9e9, "slope": 20e12}, "wholly within"),
        ({"start_frequency": 77.2e9}, "77.200-81.200 GHz"),
        ({"slope": 101e12, "ramp_end_time": 30e-6, "samples": 32}, "slope is 101 MHz/us, expected at most 100"),
        ({"sample_rate": 1.9e6, "samples": 64}, "sample_rate is 1.9 Msps"),
        ({"sample_rate": 13e6}, "sample_rate is 13 Msps"),
        ({"idle_time": 6.9e-6}, "idle_time is 6.9 us, expected at least 7 us"),
        ({"idle_time": 4.9e-6, "slope": 60e12}, "expected at least 5 us"),
        ({"idle_time": 3.4e-6, "slope": 40e12}, "expected at least 3.5 us"),
        ({"idle_time": 1.9e-6, "slope": 19e12}, "expected at least 2 us"),
        ({"idle_time": 4e-6, "slope": 19e12, "ramp_end_time": 10e-6, "samples": 4}, "expected at least 15 us"),
        ({"samples": 95}, "samples is 95, expected an even number"),
        ({"loops": 256, "frame_period": 0.5}, "loops is 256"),
        ({"frame_period": 1.4}, "frame_period is 1400 ms"),
        ({"frame_period": 16.6e-3}, "at least 0.3 ms more"),
        ({"idle_time": 7e-6, "frame_period": 9e-3}, "RF on for 53.3%"),
        ({"samples": 280, "sample_rate": 12.5e6, "loops": 80, "frame_period": 80e-3}, "frame of 1075200 bytes"),
        ({"samples": 1100, "sample_rate": 12.5e6, "ramp_end_time": 100e-6, "slope": 40e12, "loops": 8}, "17600 bytes"),
    ],
)
def test_each_limit_is_named(change, message):
    with pytest.raises(InputError) as error:
        check_limits(BASE.model_copy(update=change), demo=True)
    assert message in str(error.value)


def test_the_demo_alone_keeps_a_frame_in_memory():
    """RadarHD's frames of 1.5 MiB were streamed with mmWave Studio."""
    check_limits(PRESETS["radarhd"])
    with pytest.raises(InputError, match="frame of 1572864 bytes, expected at most 1048576"):
        check_limits(PRESETS["radarhd"], demo=True)


def test_lvds_is_the_bottleneck_of_fast_chirps():
    fast = {"samples": 144, "sample_rate": 12.5e6, "ramp_end_time": 12.6e-6, "adc_start_time": 1e-6, "slope": 79e12}
    slow = BASE.model_copy(update=fast | {"idle_time": 2.5e-6})  # 4 RX x 144 x 4 B over 1.2 Gbit/s: 15.36 us
    with pytest.raises(InputError, match="15.36 us over LVDS"):
        check_limits(slow)
    check_limits(BASE.model_copy(update=fast | {"idle_time": 3e-6}))
