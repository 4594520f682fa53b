"""Each effect of the front end against its closed form, and against the ideal front end when switched off."""

import numpy as np
import pytest

from benchmarks.references.front_end import CONFIG, PHASE_NOISE, db, law, noise_factor, power_by_bin, rng, skirt, tone
from radarize.io.errors import InputError
from radarize.radar.config import SPEED_OF_LIGHT
from radarsim.propagation.antenna import ISOTROPIC, Antenna, amplitude_gain, gain_pattern
from radarsim.receiver.frontend import FrontEnd
from radarsim.receiver.frontend_config import Band, Channel, FrontEndConfig, Leakage, Mismatch, MountEcho

SHAPE = CONFIG.frame_shape[:-1]
N = CONFIG.samples
OFF = FrontEndConfig.ideal()


# --- thermal noise ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gain", [24.0, 30.0, 38.0, 48.0])
def test_noise_by_receive_gain(gain):
    """k T B F G with the noise figure at the gain."""
    config = CONFIG.model_copy(update={"rx_gain_db": gain})
    counts = FrontEnd(config, FrontEndConfig.ideal(noise=True)).receive(np.zeros(SHAPE, np.complex64), rng())
    watts = 1.380649e-23 * 290 * CONFIG.sample_rate * noise_factor(gain) * 10 ** (gain / 10)
    expected = watts / (1e-3 * 10**0.5) * 32767**2
    assert db(np.mean(np.abs(counts) ** 2) / expected) == pytest.approx(0, abs=0.05)


def test_noise_figure_of_one_measurement_holds_for_every_gain():
    settings = FrontEndConfig.of(CONFIG.board, noise_figure_db={30: 13.0})
    assert db(settings.noise_factor(24)) == db(settings.noise_factor(48)) == pytest.approx(13.0)


@pytest.mark.parametrize("band", [Band(), Band(low=-0.3, flat=0.8, high=1.4)], ids=["default", "wide"])
def test_noise_folds_as_echoes_do(band):
    """Its spectrum equals white noise of the same density at eight times the rate, filtered and decimated."""
    front = FrontEnd(CONFIG, FrontEndConfig.ideal(noise=True, band=band))
    found = sum(power_by_bin(front.receive(np.zeros(SHAPE, np.complex64), np.random.default_rng(k))) for k in range(8))
    white = rng().normal(size=(3000, 8 * N, 2)).view(complex)[..., 0] * np.sqrt(front._bin_noise * N / 2 * 8)
    beat = np.fft.fftfreq(8 * N, 1 / (8 * CONFIG.sample_rate))
    sampled = np.fft.ifft(np.fft.fft(white) * front.beat_response(beat))[:, ::8]
    truth = power_by_bin(sampled[:, None, None])
    assert db(found / 8 / truth) == pytest.approx(np.zeros(N), abs=0.5)


# --- converter -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("bits", [8, 10, 12])
def test_quantisation_noise(bits):
    """A full-scale sine over the noise of b bits: 6.02 b + 1.76 dB."""
    front = FrontEnd(CONFIG, FrontEndConfig.ideal(adc_bits=bits))
    phase = 2 * np.pi * rng().random((64, *SHAPE[1:]))
    counts = (32767 * np.exp(1j * phase)).astype(np.complex64)
    error = front.convert(counts)[..., 0] - counts.real
    within = np.abs(counts.real) < 32767 - 2 ** (16 - bits)
    ratio = np.mean(counts.real**2) / np.mean(error[within] ** 2)
    assert db(ratio) == pytest.approx(6.02 * bits + 1.76, abs=0.1)
    assert not np.any(front.convert(counts) % 2 ** (16 - bits))


def test_full_scale_is_a_power():
    """A tone of full-scale power at the converter reads 32767 counts."""
    front = FrontEnd(CONFIG, OFF)
    level = OFF.full_scale_dbm - CONFIG.rx_gain_db - OFF.tx_power_dbm
    assert np.abs(front.receive(tone(20, level), rng())).max() == pytest.approx(32767, rel=1e-5)


# --- leakage ---------------------------------------------------------------------------------------------------------
def test_leakage_level_and_place():
    """Static tone at slope x delay, at its level after the high-pass filter, with a different phase per channel."""
    delay, level = 8e-9, -50.0
    settings = FrontEndConfig.ideal(leakage=Leakage(level_db=level, delay=delay), high_pass=True)
    counts = FrontEnd(CONFIG, settings, rng()).receive(np.zeros(SHAPE, np.complex64), rng())
    assert np.allclose(counts, counts[:1])
    spectrum = np.abs(np.fft.fft(counts[0], 64 * N, axis=-1)) / N
    assert spectrum.argmax(axis=-1) / 64 * CONFIG.range_resolution == pytest.approx(
        np.full((3, 4), SPEED_OF_LIGHT * delay / 2), abs=CONFIG.range_resolution / 64
    )
    beat = CONFIG.slope * delay
    filtered = beat**4 / (beat**2 + 175e3**2) / (beat**2 + 350e3**2)
    dbm = level + 12 + db(filtered)
    expected = 20 * np.log10(32767) + dbm + CONFIG.rx_gain_db - settings.full_scale_dbm
    assert 20 * np.log10(spectrum.max(axis=-1)) == pytest.approx(np.full((3, 4), expected), abs=0.01)
    assert len(np.unique(np.angle(counts[0, :, :, 0]).round(3))) == 12


def test_measured_leakage_is_taken_as_it_is():
    channels = tuple(Channel(gain_db=-40 - k, phase_deg=10 * k) for k in range(12))
    config = CONFIG.model_copy(update={"tx_order": (2, 0), "rx": (1, 3)})
    front = FrontEnd(config, FrontEndConfig.ideal(leakage=Leakage(channels=channels)))
    assert 20 * np.log10(np.abs(front.leakage)) == pytest.approx(np.array([[-41, -43], [-49, -51]]))
    assert np.rad2deg(np.angle(front.leakage)) == pytest.approx(np.array([[10, 30], [90, 110]]))


# --- mount -----------------------------------------------------------------------------------------------------------
def test_mount_echoes_levels_and_places():
    """An empty scene's range profile: an echo at each distance, at its channel's level behind the high-pass filter."""
    channels = tuple(Channel(gain_db=-60 - k, phase_deg=25 * k) for k in range(12))
    mount = [MountEcho(distance=0.3, level_db=-60, channels=channels), MountEcho(distance=0.9, level_db=-70)]
    settings = FrontEndConfig.ideal(mount=mount, high_pass=True)
    front = FrontEnd(CONFIG, settings, rng())
    counts = front.receive(np.zeros(SHAPE, np.complex64), rng())
    assert np.array_equal(counts, np.broadcast_to(counts[:1], counts.shape))  # constant in time
    t = (np.arange(N) - (N - 1) / 2) / CONFIG.sample_rate
    beats = CONFIG.slope * 2 * np.array([0.3, 0.9]) / SPEED_OF_LIGHT
    found, *_ = np.linalg.lstsq(np.exp(2j * np.pi * np.outer(t, beats)), counts[0].reshape(12, N).T, rcond=None)
    high_pass = (1j * beats / (1j * beats + 175e3)) * (1j * beats / (1j * beats + 350e3))
    scale = 32767 * 10 ** ((12 + CONFIG.rx_gain_db - settings.full_scale_dbm) / 20)
    expected = np.stack([np.array([c.factor for c in channels]), front.mount[1].ravel()]) * high_pass[:, None] * scale
    assert np.abs(found / expected - 1).max() < 1e-4
    residual = counts[0].reshape(12, N).T - np.exp(2j * np.pi * np.outer(t, beats)) @ found
    assert np.abs(residual).max() < 1e-4 * np.abs(found).max()


def test_mount_belongs_to_the_board():
    """Amplitudes differ by channel, follow from the board's seed, and have a complex normal distribution."""
    boards = np.stack([FrontEnd(CONFIG, rng=np.random.default_rng(k)).mount[0] for k in range(400)])
    assert np.array_equal(boards[7], FrontEnd(CONFIG, rng=np.random.default_rng(7)).mount[0])
    assert len(np.unique(np.angle(boards[7]).round(3))) == 12 and not np.isclose(boards[7], boards[8]).any()
    power = np.abs(boards) ** 2 / 10 ** (FrontEndConfig.of(CONFIG.board).mount[0].level_db / 10)
    assert power.mean() == pytest.approx(1, abs=0.04) and (power**2).mean() == pytest.approx(2, abs=0.15)
    without = FrontEnd(CONFIG, FrontEndConfig.of(CONFIG.board, mount=None), np.random.default_rng(7))
    whole = FrontEnd(CONFIG, rng=np.random.default_rng(7))
    assert not len(without.mount) and np.array_equal(without.leakage, whole.leakage)


def test_mount_has_the_phase_noise_of_its_delay():
    mount = [MountEcho(distance=0.3, level_db=-20)]
    front = FrontEnd(CONFIG, FrontEndConfig.ideal(mount=mount, phase_noise=PHASE_NOISE))
    counts = front.receive(np.zeros(SHAPE, np.complex64), rng())
    power = power_by_bin(counts - counts.mean(axis=0))[20:80]
    f = np.arange(20, 80) * CONFIG.sample_rate / N
    density = np.where(f < 316e3, -83, -93 - 20 * np.log10(f / 1e6))
    carrier = np.mean(np.abs(front.scale * front.mount[0]) ** 2)
    correlated = 4 * np.sin(np.pi * f * 0.6 / SPEED_OF_LIGHT) ** 2
    expected = carrier * np.mean(10 ** (density / 10) * correlated) * CONFIG.sample_rate / N
    assert db(power.mean() / expected) == pytest.approx(0, abs=0.4)


# --- phase noise -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cell", [20, 45, 90])
def test_phase_noise_skirt(cell):
    found = skirt(cell)
    bins = np.arange(N)
    for low, high in ((5, 12), (13, 30), (31, 60)):
        ring = (np.abs(bins - cell) >= low) & (np.abs(bins - cell) < high)
        expected = law(cell, bins[ring] - cell).mean()
        assert db(found[ring].mean() / expected) == pytest.approx(0, abs=0.4)


def test_phase_noise_at_one_megahertz():
    """The data sheet's point itself: -93 dBc/Hz less the range correlation of 4.3 m, and 2 dB less in 76-77 GHz."""
    cell, off = 90, 42  # 42 bins are 1.0 MHz
    assert off * CONFIG.sample_rate / N == pytest.approx(1e6, rel=2e-3)
    expected = -93 + db(4 * np.sin(np.pi * 1e6 * cell / CONFIG.bandwidth) ** 2) + db(CONFIG.sample_rate / N)
    assert db(skirt(cell)[cell - off - 1 : cell - off + 2].mean()) == pytest.approx(expected, abs=0.6)
    low = CONFIG.model_copy(update={"start_frequency": 76e9, "slope": 20e12})
    low_law = law(cell, np.arange(40, 45), config=low).mean()
    assert db(skirt(cell, config=low)[cell - 44 : cell - 39].mean() / low_law) == pytest.approx(-2.0, abs=0.6)


def test_near_echoes_have_no_skirt():
    """Range correlation: 6 dB less for half the delay; the leakage's sidebands are those of its own delay,
    negligible."""
    far, near = skirt(80)[20:40].mean(), skirt(10)[70:90].mean()
    offset = db(law(80, np.arange(20, 40) - 80).mean() / law(10, np.arange(70, 90) - 10).mean())
    assert offset > 15
    assert db(far / near) == pytest.approx(offset, abs=0.5)
    leak = FrontEndConfig.ideal(leakage=Leakage(level_db=-20, delay=0.5e-9), phase_noise=PHASE_NOISE)
    counts = FrontEnd(CONFIG, leak).receive(np.zeros(SHAPE, np.complex64), rng())
    power = power_by_bin(counts - counts.mean(axis=0))[10:80]
    f = np.arange(10, 80) * CONFIG.sample_rate / N
    density = np.where(f < 316e3, -83, -93 - 20 * np.log10(f / 1e6))
    carrier = (FrontEnd(CONFIG, leak).scale * 0.1) ** 2
    expected = carrier * np.mean(10 ** (density / 10) * 4 * np.sin(np.pi * f * 0.5e-9) ** 2) * CONFIG.sample_rate / N
    assert db(power.mean() / expected) == pytest.approx(0, abs=0.4)


def test_phase_noise_is_common_to_the_receivers_of_a_chirp():
    counts = FrontEnd(CONFIG, FrontEndConfig.ideal(phase_noise=PHASE_NOISE)).receive(tone(60, -40), rng())
    rest = counts - counts.mean(axis=(0, 1), keepdims=True)
    within = np.abs(np.vdot(rest[:, :, 0], rest[:, :, 3])) / np.linalg.norm(rest[:, :, 0]) ** 2
    between = np.abs(np.vdot(rest[1:], rest[:-1])) / np.linalg.norm(rest) ** 2
    assert within > 0.999 and between < 0.2


def test_skirts_below_the_noise_may_be_left_out():
    """The speed-up for weak echoes removes less than 1 % of the noise in any bin."""
    settings = FrontEndConfig.ideal(noise=True, phase_noise=PHASE_NOISE)
    weak, plain = (FrontEnd(CONFIG, s).receive(tone(60, -75), rng()) for s in (settings, OFF))
    noise = power_by_bin(weak - plain)
    assert db(noise / FrontEnd(CONFIG, settings)._bin_noise) == pytest.approx(np.zeros(N), abs=1.2)


# --- image -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("cell", [3, 30, 44])
def test_image_rejection(cell):
    """30 dB below the echo at the opposite beat frequency, if no filter removes it."""
    counts = FrontEnd(CONFIG, FrontEndConfig.ideal(image_rejection_db=30.0)).receive(tone(cell, -60), rng())
    power = power_by_bin(counts)
    assert db(power[N - cell] / power[cell]) == pytest.approx(-30, abs=0.01)
    others = np.delete(power, [cell, N - cell])
    assert db(others.max() / power[cell]) < -80


def test_complex_sampling_filters_images_away():
    """As in real captures: images of near echoes only, by the decimation filter's response at -f."""
    settings = FrontEndConfig.ideal(image_rejection_db=30.0, band=Band(low=-0.06))
    near = power_by_bin(FrontEnd(CONFIG, settings).receive(tone(2, -60), rng()))
    assert db(near[N - 2] / near[2]) == pytest.approx(-30 + 20 * np.log10(1 - 2 / N / 0.06), abs=0.01)
    far = power_by_bin(FrontEnd(CONFIG, settings).receive(tone(20, -60), rng()))
    assert db(far[N - 20] / far[20]) < -80


# --- channels --------------------------------------------------------------------------------------------------------
def test_mismatch_statistics():
    """Within +-0.5 dB and +-3 deg, spread over most of it, as products of TX and RX errors, from the board's seed."""
    boards = np.stack([FrontEnd(CONFIG, rng=np.random.default_rng(k)).channel for k in range(400)])
    gain, phase = 20 * np.log10(np.abs(boards)), np.rad2deg(np.angle(boards))
    assert 0.4 < np.abs(gain).max() <= 0.5 and 2.4 < np.abs(phase).max() <= 3.0
    # the sum of two uniform errors of half the bound has a variance of bound^2 / 6
    assert gain.std() == pytest.approx(0.5 / np.sqrt(6), rel=0.1) and abs(gain.mean()) < 0.02
    assert phase.std() == pytest.approx(3 / np.sqrt(6), rel=0.1) and abs(phase.mean()) < 0.15
    ratio = boards[:, :, 1:] / boards[:, :, :1]
    assert np.allclose(ratio, ratio[:, :1])
    assert np.array_equal(boards[5], FrontEnd(CONFIG, rng=np.random.default_rng(5)).channel)


def test_mismatch_acts_on_every_echo():
    front = FrontEnd(CONFIG, FrontEndConfig.ideal(mismatch=Mismatch(gain_db=2, phase_deg=40)), rng())
    counts, plain = front.receive(tone(30, -60), rng()), FrontEnd(CONFIG, OFF).receive(tone(30, -60), rng())
    assert np.allclose(counts / plain, front.channel[:, :, None], rtol=1e-4)


# --- antenna ---------------------------------------------------------------------------------------------------------
def test_antenna_pattern():
    """10.5 dBi; 3 dB down at 28 deg azimuth and 14 deg elevation, 6 dB at 50 and 20."""
    tables = gain_pattern(Antenna.of(CONFIG.board))
    for azimuth, elevation, expected in ((0, 0, 10.5), (28, 0, 7.5), (-50, 0, 4.5), (0, 14, 7.5), (0, -20, 4.5)):
        a, e = np.deg2rad([azimuth, elevation])
        gain = amplitude_gain(np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e), tables)
        assert 20 * np.log10(gain) == pytest.approx(expected, abs=0.01)
    assert amplitude_gain(-1.0, 0.1, 0.0, tables) == 0
    assert amplitude_gain(1.0, 2.0, -1.0, gain_pattern(ISOTROPIC)) == 1


# --- switches and files ----------------------------------------------------------------------------------------------
def test_everything_off_is_the_ideal():
    """Only a scale factor remains: counts are the signal times the full-scale factor, to float32."""
    signal = (rng().normal(size=(*SHAPE, 2)) * 1e-4).astype(np.float32).view(np.complex64)[..., 0]
    front = FrontEnd(CONFIG, OFF)
    scale = 32767 * 10 ** ((CONFIG.rx_gain_db - 5 + 12 - CONFIG.tx_backoff_db) / 20)
    assert np.allclose(front.receive(signal, rng()), signal * scale, rtol=1e-5)
    assert np.array_equal(front.if_response(np.array([0.01, 3.0, 100.0])), np.ones(3))


@pytest.mark.parametrize(
    "switch",
    [
        {"noise": False},
        {"leakage": None},
        {"mount": None},
        {"mismatch": None},
        {"phase_noise": None},
        {"high_pass": False},
        {"band": None},
        {"image_rejection_db": None},
        {"antenna": None},
    ],
    ids=lambda s: next(iter(s)),
)
def test_each_switch_does_something_alone(switch):
    """With all effects but one, the samples differ from those with all effects."""
    name = next(iter(switch))
    on = FrontEnd(CONFIG, rng=rng())
    off = FrontEnd(CONFIG, FrontEndConfig.of(CONFIG.board, **switch), rng())
    if name == "antenna":
        assert off.settings.pattern == ISOTROPIC and on.settings.pattern == Antenna.of(CONFIG.board)
    elif name == "high_pass":
        assert abs(off.if_response(np.array(0.5))) == 1 > abs(on.if_response(np.array(0.5)))
    else:
        a, b = (f.receive(tone(3, -40), rng()) for f in (on, off))
        assert not np.allclose(a, b)


def test_parts_by_cause_add_up():
    """With noise off, what each signal makes and the leakage are together what the front end makes of their sum."""
    front = FrontEnd(CONFIG, FrontEndConfig.of(CONFIG.board, noise=False, phase_noise=None), rng())
    signals = [tone(3, -60), tone(30.3, -70), tone(70.9, -80)]
    parts, whole = front.by_path_type(signals), front.receive(np.sum(signals, axis=0), rng())
    assert len(parts) == 4
    assert np.abs(np.sum(parts, axis=0) - whole).max() < 1e-5 * np.abs(whole).max()


def test_files_round_trip(tmp_path):
    settings = FrontEndConfig.of(
        CONFIG.board, noise_figure_db={30: 14.0}, leakage=None, mismatch=Mismatch(gain_db=1), adc_bits=12
    )
    settings.save(tmp_path / "board.yaml", ["measured on a Sunday"])
    assert FrontEndConfig.load(tmp_path / "board.yaml", CONFIG.board) == settings
    assert (tmp_path / "board.yaml").read_text().startswith("# measured on a Sunday")
    (tmp_path / "part.yaml").write_text("tx_power_dbm: 10\n")
    assert FrontEndConfig.load(tmp_path / "part.yaml", CONFIG.board) == FrontEndConfig.of(CONFIG.board, tx_power_dbm=10)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("tx_powr: 3", "tx_powr: unknown key"),
        ("adc_bits: 24", "adc_bits is 24"),
        ("leakage: {level_db: 10}", "leakage.level_db is 10"),
        ("mount: [{distance: 3, level_db: -70}]", "mount[0].distance is 3"),
        ("mismatch: {channels: [{gain_db: 0, phase_deg: 0}]}", "channels has 1 entries, expected 12"),
        ("antenna: {azimuth: {degrees: [0, 50], loss_db: [0, 3]}}", "expected ascending from 0 to 90"),
        ("phase_noise: {offset_hz: [1e6, 1e5], dbc_hz: [-90, -100]}", "ascending"),
        ("[1, 2]", "holds list"),
        ("a: [", "malformed YAML"),
    ],
)
def test_bad_files_are_refused_in_a_sentence(tmp_path, text, words):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        FrontEndConfig.load(path, CONFIG.board)
    assert words in str(caught.value) and "bad.yaml" in str(caught.value) and "\n" not in str(caught.value)
