"""The public captures as recordings."""

from pathlib import Path

from radarize.io.importers import Given, import_recording


def captures(source: Path, folder: Path) -> dict[str, Path]:
    """The public captures (see their README) as recordings, by name: one frame each, of a radar at rest.

    Args:
        source: folder of the captures.
        folder: where recordings are written.
    """
    pcap = source / "iwr1843-pcap" / "test_one_frame.pcap"
    people = source / "xwr-moving-people" / "doppler_example_1.npy"
    chirps = {"tx": (0, 2), "start_frequency": 77e9, "slope": 60.012e12, "sample_rate": 2.5e6, "idle_time": 30e-6,
              "ramp_end_time": 62e-6, "adc_start_time": 6e-6}  # fmt: skip
    return {
        "pcap": import_recording(pcap, folder / "pcap.h5", Given(overrides={"samples": 256, "loops": 16, "rx": 1})),
        "studio": import_recording(source / "iwr6843-studio", folder / "studio.h5"),
        "people": import_recording(people, folder / "people.h5", Given(shape="loop,virtual,sample", overrides=chirps)),
    }
