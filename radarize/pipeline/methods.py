"""Methods of odometry and of scans by name, and the pipelines made of them: the values of ``--odometry`` and
``--scans`` and of benchmarks.

A method is an entry point of the group ``radarize.odometry`` or ``radarize.scans`` in the ``pyproject.toml`` of this or
any other package; its value is a `Method`. A program may also add one at run time: ``SCANS["mine"] = Method(...)``.
"""

from radarize.io.errors import InputError
from radarize.io.plugins import Plugins
from radarize.learning.nets.weights import check, header_of
from radarize.pipeline.method import Inputs, Method, Weights
from radarize.pipeline.pipeline import OdometryEstimator, Pipeline, ScanExtractor
from radarize.radar.config import RadarConfig
from radarize.signal.polar import pictured

ODOMETRY: Plugins[Method] = Plugins("radarize.odometry", "odometry")
SCANS: Plugins[Method] = Plugins("radarize.scans", "scans")
#: Default methods.
BEST = {"odometry": "fused", "scans": "segmentation"}
#: Default methods for radars that the shipped networks do not fit.
CLASSICAL = {"odometry": "doppler", "scans": "first-echo"}
#: Default methods for recordings of polar pictures.
PICTURED = {"odometry": "pictures", "scans": "pictures"}


def make_odometry(inputs: Inputs, name: str) -> OdometryEstimator:
    """Make odometry by its name in `ODOMETRY`.

    Raises:
        InputError: unknown name, or the method lacks something, see `Method`.
    """
    return _readable(ODOMETRY, name, inputs).make(inputs)


def make_scans(inputs: Inputs, name: str) -> ScanExtractor:
    """Make an extractor of scans by its name in `SCANS`.

    Raises:
        InputError: unknown name, or the method lacks something, see `Method`.
    """
    return _readable(SCANS, name, inputs).make(inputs)


def make_pipeline(inputs: Inputs, odometry: str, scans: str, endless: bool = False) -> Pipeline:
    """Make a pipeline from the names of its methods.

    Args:
        inputs: inputs of the methods.
        odometry, scans: keys of `ODOMETRY` and `SCANS`.
        endless: see `radarize.slam.backend.Slam`.

    Raises:
        InputError: unknown name, or a method lacks something, see `Method`.
    """
    return Pipeline(make_odometry(inputs, odometry), make_scans(inputs, scans), inputs.configuration.slam, endless)


def _readable(known: Plugins[Method], name: str, inputs: Inputs) -> Method:
    """Return the method, if it can read the recording."""
    recording, method, what = inputs.recording, known.find(name), known.what
    if recording is not None and not recording.has_samples and not (method.pictures or method.scans):
        wanted = f"{what} {PICTURED[what]}" if pictured(recording) else "a recording with /radar/adc"
        raise InputError(f"{recording.path}: has no raw samples, which {what} {name} needs, expected {wanted}")
    return method


def choose_methods(
    radar: RadarConfig,
    odometry: str | None = None,
    scans: str | None = None,
    *,
    own_weights: bool = False,
    pictures: bool = False,
) -> tuple[dict[str, str], str]:
    """Return odometry and scans by name, with defaults for what is not given, and why the defaults have no networks.

    Args:
        radar: configuration of the radar.
        odometry, scans: names, if given.
        own_weights: the networks are the user's, so the shipped ones need not fit the radar.
        pictures: the recording has polar pictures instead of samples.
    """
    best, why = (PICTURED, "") if pictures else (BEST, "") if own_weights else best_methods(radar)
    return {"odometry": odometry or best["odometry"], "scans": scans or best["scans"]}, why


def best_methods(radar: RadarConfig) -> tuple[dict[str, str], str]:
    """Return the default odometry and scans for a radar, and why they are classical ones if they are."""
    chosen, why, weights = dict(BEST), [], Weights()
    for what, known in (("odometry", ODOMETRY), ("scans", SCANS)):
        try:
            for kind in known.find(BEST[what]).needed(radar):
                check(weights.of(kind), radar)
        except InputError as error:
            chosen[what] = CLASSICAL[what]
            why.append(str(error))
    return chosen, "; ".join(why)


def pace(odometry: str, radar: RadarConfig) -> int:
    """Return N such that odometry needs every N-th frame only.

    A network for rotation is trained at one frame rate, and a higher rate does not improve odometry with it. Without
    such a network all frames are used.

    Raises:
        InputError: unknown name.
    """
    if "rotation" not in ODOMETRY.find(odometry).networks:
        return 1
    trained = header_of(Weights().of("rotation")).grid
    return max(1, int(trained.frame_period / radar.frame_period * (1 + 1e-3))) if trained else 1
