"""Methods of odometry and of scans by name, and the pipelines made of them: what ``--odometry`` and ``--scans`` accept
and benchmarks compare.

A method is an entry point of the group ``radarize.odometry`` or ``radarize.scans`` in the ``pyproject.toml`` of this or
any other package; its value is a `Method`. A program may also add one itself: ``SCANS["mine"] = Method(...)``.
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
#: Methods of choice.
BEST = {"odometry": "fused", "scans": "segmentation"}
#: Methods without networks, for radars that the shipped ones do not fit.
CLASSICAL = {"odometry": "doppler", "scans": "first-echo"}
#: Methods for recordings of pictures.
PICTURED = {"odometry": "pictures", "scans": "pictures"}


def make_odometry(inputs: Inputs, name: str) -> OdometryEstimator:
    """Make odometry by a key of `ODOMETRY`.

    Raises:
        InputError: unknown name, or see `Method`.
    """
    return _readable(ODOMETRY, name, inputs).make(inputs)


def make_scans(inputs: Inputs, name: str) -> ScanExtractor:
    """Make an extractor of scans by a key of `SCANS`.

    Raises:
        InputError: unknown name, or see `Method`.
    """
    return _readable(SCANS, name, inputs).make(inputs)


def make_pipeline(inputs: Inputs, odometry: str, scans: str, endless: bool = False) -> Pipeline:
    """Make a pipeline by the names of its methods.

    Args:
        inputs: what methods are made from.
        odometry, scans: keys of `ODOMETRY` and `SCANS`.
        endless: as of `radarize.slam.backend.Slam`.

    Raises:
        InputError: unknown name, or see `Method`.
    """
    return Pipeline(make_odometry(inputs, odometry), make_scans(inputs, scans), inputs.configuration.slam, endless)


def _readable(known: Plugins[Method], name: str, inputs: Inputs) -> Method:
    """The method, if it can read the recording."""
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
    """Methods by what they are for, those of choice where none is named; and why these have no networks, if so.

    Args:
        radar: configuration.
        odometry, scans: names, if given.
        own_weights: networks are the user's, so the shipped ones need not fit the radar.
        pictures: the recording holds pictures and no samples.
    """
    best, why = (PICTURED, "") if pictures else (BEST, "") if own_weights else best_methods(radar)
    return {"odometry": odometry or best["odometry"], "scans": scans or best["scans"]}, why


def best_methods(radar: RadarConfig) -> tuple[dict[str, str], str]:
    """Odometry and scans of choice for a radar, and where these are classical ones, why."""
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
    """Every N-th frame is enough for odometry: a network of turns was trained at a frame rate of its own, and odometry
    with it is no better where frames come more often. Without one, every frame counts.

    Raises:
        InputError: unknown name.
    """
    if "rotation" not in ODOMETRY.find(odometry).networks:
        return 1
    taught = header_of(Weights().of("rotation")).grid
    return max(1, int(taught.frame_period / radar.frame_period * (1 + 1e-3))) if taught else 1
