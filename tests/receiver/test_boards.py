"""Round trip of every board's file: a sphere at a known place, simulated with the board's front end, is located by the
calibrated array; also for a board's file outside the package."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.references.rigs import polar
from radarize.io.errors import InputError
from radarize.io.importers.parameters import Given
from radarize.io.recording import Recording
from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.boards import BOARDS
from radarize.radar.cfg import parse_cfg, write_cfg
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS, load_config
from radarize.signal.heatmaps import Heatmaps
from radarize.signal.points import PointCloudConfig, PointClouds
from radarsim.dataset.specification import Specification
from radarsim.dataset.variant import Variant
from radarsim.emulator.simulation import Simulation
from radarsim.motion.trajectory import Motion
from radarsim.motion.walk import Walk
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.scatterers import Scatterers
from radarsim.receiver.frontend import FrontEnd
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.receiver.phasenoise import density
from radarsim.recording.simulate import simulate
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene
from tests.radars import radar, resolves_elevation

PRESET = PRESETS["radarize"]
MEASURED = tuple((float(k), 0.5) for k in range(12))
#: Three rows of antennas, the receivers in a column and half of them turned: no layout of TI's.
OWN = """
source: a test
chip: iwr6843
design_frequency: 61.0e+9
tx: [[0, 0], [1, 0], [2, 0]]
rx: [[0, 0], [0, 1], [0, 2], [3, 0]]
rx_sign: [-1, 1, -1, 1]
front_end:
  antenna:
    peak_dbi: 3.0
    azimuth: {degrees: [0, 90], loss_db: [0, 9]}
    elevation: {degrees: [0, 90], loss_db: [0, 9]}
  tx_power_dbm: 9.0
  noise_figure_db: {30: 11.0}
  phase_noise: null
  if_bandwidth_hz: 5.0e+6
"""


def sphere(azimuth: float, elevation: float) -> Scene:
    """A metal sphere of 0.5 m^2 in free space, its nearest point 2.5 m from the origin."""
    place = polar(2.9, azimuth, elevation).tolist()
    fields = {"name": "ball", "shape": "sphere", "radius": 0.4, "material": "metal", "position": place}
    return Scene.of({"objects": [fields]}, "sphere")


def burst(scene: Scene, config: RadarConfig) -> np.ndarray:
    """Frame of a radar at rest at the origin."""
    return Scenario(scene, Motion.still((0, 0, 0), duration=1.0), config, seed=2).frames(np.zeros(1)).samples


def found(config: RadarConfig, samples: np.ndarray) -> tuple[float, float, float]:
    """Range (m), azimuth and elevation (deg) of the strongest echo, by the best fit of a plane wave to its snapshot,
    from the definition of its phases."""
    maps = Heatmaps(config)
    spectrum = maps.spectrum(samples)[0].numpy()
    power = (np.abs(spectrum) ** 2).sum(axis=-1) * (abs(maps.ranges - 2.2) < 1.9)[:, None]  # leakage is around zero
    row, column = np.unravel_index(power.argmax(), power.shape)
    ends = (60, 35 if resolves_elevation(config) else 0)
    a, e = np.meshgrid(*(np.deg2rad(np.arange(-end, end + 0.1, 0.5)) for end in ends), indexing="ij")
    towards = np.stack([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)], axis=-1)
    antennas = (tx_positions(config)[:, None] + rx_positions(config)).reshape(-1, 3)
    waves = np.exp(-2j * np.pi / config.wavelength * (towards @ antennas.T))
    best = np.unravel_index(np.abs(waves.conj() @ spectrum[row, column]).argmax(), a.shape)
    return maps.ranges[row], np.rad2deg(a[best]), np.rad2deg(e[best])


@pytest.fixture
def own(tmp_path) -> Path:
    """Board's file outside the package."""
    (tmp_path / "mine.yaml").write_text(OWN)
    return tmp_path / "mine.yaml"


# --- round trip ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("board", [*BOARDS, "mine.yaml"])
@pytest.mark.parametrize(("azimuth", "elevation"), [(20, 12), (-15, -10)])
def test_a_target_is_found_where_it_is(own, board, azimuth, elevation):
    """Within the effect of the channels' errors, 3 deg at most, on four antennas in a row or two in a column. An array
    without elevation gives level directions."""
    config = radar(own if board == "mine.yaml" else board)
    elevation = elevation if resolves_elevation(config) else 0
    distance, left, up = found(config, burst(sphere(azimuth, elevation), config))
    assert distance == pytest.approx(2.5, abs=config.range_resolution)
    assert left == pytest.approx(azimuth, abs=1.5) and up == pytest.approx(elevation, abs=2.0)


@pytest.mark.parametrize("board", [name for name in BOARDS if resolves_elevation(radar(name))])
def test_elevation_aware_maps_show_what_is_level(board):
    """The mean of an elevation pair passes a level echo unattenuated, as in the plain map. With uncorrected receiver
    signs, a pair of the AOP cancels."""
    config = radar(board)
    maps, samples = Heatmaps(config), burst(sphere(0, 0), config)
    row = abs(maps.ranges - 2.5).argmin()
    aware, plain = maps.elevation_aware(samples)[0, row].max(), maps.range_azimuth(samples)[0, row].max()
    assert 10 * np.log10(aware / plain) == pytest.approx(0, abs=0.5)
    if board == "iwr6843aop":
        wrong = Heatmaps(config.model_copy(update={"channel_calibration": ((1.0, 0.0),) * 12}))
        assert 10 * np.log10(wrong.elevation_aware(samples)[0, row].max() / plain) < -25


NEW = ("awr1642boost", "iwr1443boost", "awr1843aop", "awr2243boost", "awr2944evm", "iwrl6432boost", "awrl6844evm")


@pytest.mark.parametrize("board", NEW)
def test_points_of_two_seconds_lie_where_the_target_is(tmp_path, board):
    """From a .cfg through a recording to the chip's point cloud: azimuth, and elevation where the array resolves it."""
    config = radar(board).changed("radar", frame_period=0.25, loops=16)
    (tmp_path / "radar.cfg").write_text(write_cfg(config))
    elevation = 8 if resolves_elevation(config) else 0
    simulate(
        sphere(15, elevation), tmp_path / "a.h5", radar=str(tmp_path / "radar.cfg"), duration=2.0, seed=2,
        trajectory=_still(tmp_path / "still.tum", 24),
    )  # fmt: skip
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.config == config and len(recording) == 8
        cloud, frame = PointClouds(recording.config, PointCloudConfig(min_range=1.0))(recording.adc(0, 8))
    near = np.linalg.norm(cloud[:, :3], axis=1) < 3.5  # the last bins have what leakage at no range leaves there
    cloud, frame = cloud[near], frame[near]
    assert set(frame) == set(range(8))
    x, y, z = np.array([cloud[frame == k][cloud[frame == k][:, 4].argmax(), :3] for k in range(8)]).T
    assert np.sqrt(x**2 + y**2 + z**2) == pytest.approx(2.5, abs=0.05)
    assert np.degrees(np.arcsin(y / np.sqrt(x**2 + y**2 + z**2))) == pytest.approx(
        np.degrees(np.arcsin(np.sin(np.radians(15)) * np.cos(np.radians(elevation)))), abs=3
    )
    if elevation:
        assert np.degrees(np.arctan2(z, np.hypot(x, y))) == pytest.approx(elevation, abs=3)


def test_a_board_outside_the_package_in_a_recording(own, tmp_path):
    """From a .cfg that names the file beside it, by `simulate`; the recording contains the board."""
    config = radar(own)
    text = "\n".join(["% Board: mine.yaml", *write_cfg(config).splitlines()[1:]])
    (tmp_path / "radar.cfg").write_text(text)
    simulate(
        sphere(20, 12), tmp_path / "a.h5", radar=str(tmp_path / "radar.cfg"),
        trajectory=_still(tmp_path / "still.tum"), duration=0.2, seed=2,
    )  # fmt: skip
    own.unlink()
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.config == config and str(recording.config.board) == "mine"
        assert hash(recording.config) == hash(config)  # functions of a radar are cached
        assert found(recording.config, recording.adc(0, 1))[1:] == pytest.approx((20, 12), abs=2)


def _still(path: Path, count: int = 8) -> Path:
    path.write_text("".join(f"{0.1 * k} 0 0 0 0 0 0 1\n" for k in range(count)))
    return path


def test_a_board_beside_a_specification(own, tmp_path):
    """The identity of a data set's recording changes with the content of the board's file."""
    (tmp_path / "spec.yaml").write_text(
        "name: a\nbuildings: {o: office}\nrecordings: [{building: o, platform: cart, count: 1, duration: 1}]\n"
        "variants: {x: {radar: {board: mine.yaml, start_frequency: 60e9}}}\n"
    )
    tasks = [Specification.load(tmp_path / "spec.yaml").tasks[0]]
    own.write_text(OWN.replace("tx_power_dbm: 9.0", "tx_power_dbm: 8.0"))
    tasks.append(Specification.load(tmp_path / "spec.yaml").tasks[0])
    radars = [task.variant.radar_of(task.radar) for task in tasks]
    assert [FrontEndConfig.of(each.board).tx_power_dbm for each in radars] == [9, 8]
    assert tasks[0].identity != tasks[1].identity and str(tmp_path) not in str(tasks[0].parameters)


# --- the calibration follows the board -------------------------------------------------------------------------------
def signs(config: RadarConfig) -> list[int]:
    """Signs of TX1's receivers in the calibration."""
    return config.calibration[0].real.astype(int).tolist()


def test_the_nominal_calibration_is_the_boards():
    aop = PRESET.changed("radar", board="iwr6843aop", start_frequency=60e9)
    measured = aop.changed("radar", channel_calibration=MEASURED)
    assert signs(aop) == [1, -1, 1, -1] and signs(measured) == [0, 1, 2, 3]
    assert signs(measured.changed("radar", loops=16)) == [0, 1, 2, 3]  # of the same board
    assert signs(measured.changed("radar", board="iwr6843ods")) == [1, -1, -1, 1]
    assert signs(measured.changed("radar", board="iwr6843ods", channel_calibration=MEASURED)) == [0, 1, 2, 3]
    assert signs(aop.model_copy(update={"board": "iwr6843isk"})) == [1, 1, 1, 1]
    for again in (parse_cfg(write_cfg(aop)), RadarConfig.model_validate_json(aop.model_dump_json())):
        assert again == aop and again.channel_calibration is None


@pytest.mark.parametrize("pairs", [((1.0, 0.0),) * 12, ((1.0, 0.0), (-1.0, 0.0)) * 6])
def test_ones_and_signs_are_no_measurement(pairs):
    """Calibrations of ones in TI's files, and of nominal signs in older simulated recordings, count as not measured."""
    config = RadarConfig.build("radar", **PRESET.model_dump() | {"board": "iwr6843aop", "channel_calibration": pairs})
    assert config.channel_calibration is None and signs(config) == [1, -1, 1, -1]


def test_importers_and_variants_take_the_boards():
    text = write_cfg(PRESET).replace("% Board:iwr1843boost\n", "").replace("0 77 122", "0 60 122")
    text = text.replace("% Platform:xWR18xx", "% Platform:xWR68xx_AOP")
    assert signs(parse_cfg(text)) == [1, -1, 1, -1]
    given = Given(PRESET.changed("a", channel_calibration=MEASURED), overrides={"board": "iwr6843ods"})
    assert signs(given.configure("a.bin")[0]) == [1, -1, -1, 1]
    assert signs(load_config(Variant(radar="long-range").radar_of("x.cfg"))[0]) == [1, 1, 1, 1]


def test_the_emulated_radar_is_on_the_board_that_was_asked_for(tmp_path, monkeypatch):
    """Commands name no board; the emulator uses the requested one."""
    (tmp_path / "aop.cfg").write_text(write_cfg(radar("iwr6843aop")))
    written = (tmp_path / "aop.cfg").read_text().splitlines()
    sent = parse_cfg("\n".join(line for line in written if not line.startswith("%")))
    assert sent.board == "iwr6843isk"
    seen = []
    monkeypatch.setattr("radarsim.emulator.simulation.Scenario", lambda *a, **_: seen.append(a[2]) or 1 / 0)
    with pytest.raises(ZeroDivisionError):
        next(Simulation("office", Walk("cart", 1.0), radar=str(tmp_path / "aop.cfg")).frames(sent))
    assert seen[0].board == "iwr6843aop"


# --- front ends ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("board", "eirp", "figure", "half_azimuth", "half_elevation"),
    [
        ("iwr1843boost", 22.5, 15.0, 50, 20),
        ("iwr6843isk", 18.8, 12.0, 55, 18),
        ("iwr6843ods", 17.0, 12.0, 60, 60),
        ("iwr6843aop", 15.0, 12.0, 65, 65),
    ],
)
def test_front_ends_of_the_data_sheets(board, eirp, figure, half_azimuth, half_elevation):
    """EIRP (dBm), noise figure at 48 dB of gain, -6 dB angles, and -93 dBc/Hz at 1 MHz in the upper band."""
    config, settings = radar(board), FrontEndConfig.of(board)
    assert FrontEnd(config).settings == settings
    assert settings.tx_power_dbm + settings.antenna.peak_dbi == pytest.approx(eirp)
    assert 10 * np.log10(settings.noise_factor(48)) == pytest.approx(figure, abs=0.01)
    level = 10 * np.log10(density(settings.phase_noise, config.center_frequency, np.array([1e6])))
    assert level == pytest.approx(-93.0)
    at = [np.interp(angle, cut.degrees, cut.loss_db) for angle, cut in
          ((half_azimuth, settings.antenna.azimuth), (half_elevation, settings.antenna.elevation))]  # fmt: skip
    assert at == [6.0, 6.0]


@pytest.mark.parametrize(("azimuth", "elevation", "loss"), [(0, 0, 0.0), (65, 0, 6.0), (0, -65, 6.0)])
def test_echoes_of_the_aop_have_its_gain(azimuth, elevation, loss):
    """Radar equation with 5 dBi, and 6 dB less in each direction at the edge of the field of view."""
    config = radar("iwr6843aop")
    point = Scatterers.points(polar(2.0, azimuth, elevation)[None], np.array([0.5]))
    power = np.abs(PathFinder(None, point, None, config)(np.zeros(3), np.eye(3)).amplitude[0]) ** 2
    gain = 10 ** ((5.0 - loss) / 10)
    law = gain**2 * config.wavelength**2 * 0.5 / ((4 * np.pi) ** 3 * 2.0**4)
    assert 10 * np.log10(power / law) == pytest.approx(0, abs=0.05)


def test_a_front_end_file_changes_fields_of_the_boards(tmp_path):
    (tmp_path / "part.yaml").write_text("antenna: {peak_dbi: 4}\nleakage: {delay: 1.0e-9}\n")
    found, whole = FrontEndConfig.load(tmp_path / "part.yaml", "iwr6843aop"), FrontEndConfig.of("iwr6843aop")
    assert found.antenna.peak_dbi == 4 and found.antenna.azimuth == whole.antenna.azimuth
    assert found.leakage.delay == 1e-9 and found.tx_power_dbm == whole.tx_power_dbm == 10


# --- files that cannot be used ---------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("chip: iwr6843\n", "", "has no chip"),
        ("chip: iwr6843", "chip: iwr9", "chip is 'iwr9'"),
        ("tx: [[0, 0], [1, 0], [2, 0]]", "tx: []", "tx is []"),
        ("rx_sign: [-1, 1, -1, 1]", "rx_sign: [-1, 1]", "rx_sign has 2 entries, expected one for each of 4"),
        ("rx_sign: [-1, 1", "rx_sign: [-2, 1", "rx_sign.0 is -2"),
        ("chip:", "chips: iwr6843\nchip:", "chips"),
        (OWN, "[1, 2]", "holds a list"),
        ("front_end:", "front_end:\n  2026-01-01: 3", "front_end is {"),
        ("design_frequency: 61.0e+9", "design_frequency: 61", "design_frequency is 61"),
    ],
)
def test_bad_files_are_refused_in_a_sentence(own, old, new, words):
    own.write_text(OWN.replace(old, new))
    with pytest.raises(InputError) as caught:
        radar(own)
    assert words in str(caught.value) and "mine.yaml" in str(caught.value) and "\n" not in str(caught.value)


def test_bad_front_ends_are_refused_when_simulated(own, tmp_path):
    own.write_text(OWN.replace("tx_power_dbm: 9.0", "tx_power_dbm: loud"))
    with pytest.raises(InputError, match=r"mine.yaml: front_end: tx_power_dbm is 'loud'"):
        simulate(sphere(0, 0), tmp_path / "a.h5", radar=radar(own), trajectory=_still(tmp_path / "still.tum"))


def test_unknown_boards_and_files_in_recordings(own):
    with pytest.raises(
        InputError, match="radar: board is 'iwr1', expected one of awr1642boost, .*, iwr1843boost, .*or the path"
    ):
        PRESET.changed("radar", board="iwr1")
    with pytest.raises(InputError, match=r"nowhere.yaml: no such file"):
        PRESET.changed("radar", board="nowhere.yaml")
    with pytest.raises(ValueError, match="expected one of awr1642boost, .*iwr1843boost"):  # whose file would be read?
        RadarConfig.model_validate_json(PRESET.model_dump_json().replace("iwr1843boost", str(own)))
