"""Every way to odometry and to scans, by name: what ``--odometry`` and ``--scans`` accept and benchmarks compare; and
the trainings of their networks. A method is a folder beside this file, loaded when somebody asks for it.
"""

from collections.abc import Callable

from radarize.errors import InputError
from radarize.methods import doppler, milliego, pictures, published, radarhd, radarize, ransac, rnin, scan_matching
from radarize.methods.configuration import Configuration
from radarize.methods.method import Inputs, Method, Weights, load
from radarize.methods.task import Task
from radarize.nets.weights import check, header_of
from radarize.pipeline import Follower, Pipeline, Scanner
from radarize.polar import pictured
from radarize.radar.config import RadarConfig

_FOLDERS = (radarize, doppler, ransac, scan_matching, milliego, rnin, radarhd, pictures, published)


def _all(what: str) -> dict:
    return {name: each for folder in _FOLDERS for name, each in getattr(folder, what, {}).items()}


ODOMETRY: dict[str, Method] = _all("ODOMETRY")
SCANS: dict[str, Method] = _all("SCANS")
#: Where the task of each network's training stands, see `Task`.
TASKS: dict[str, str | Callable[[], Task]] = _all("TASKS")
#: Methods of choice.
BEST = {"odometry": "fused", "scans": "segmentation"}
#: Methods without networks, for radars that the shipped ones do not fit.
CLASSICAL = {"odometry": "doppler", "scans": "first-echo"}
#: Methods for recordings of pictures.
PICTURED = {"odometry": "pictures", "scans": "pictures"}


class Workshop:
    """Makes methods, and pipelines of them. Pipelines of one workshop share what they have in common: pushed the same
    batches, spectra, maps, scans and odometry are made once.
    """

    def __init__(self, inputs: Inputs):
        self.inputs = inputs
        self._scanners: dict[str, Scanner] = {}
        self._followers: dict[tuple[str, str | None], Follower] = {}

    def scanner(self, name: str) -> Scanner:
        """Scans by a key of `SCANS`.

        Raises:
            InputError: unknown name, or see `Method`.
        """
        if name not in self._scanners:
            method = self._method("scans", name, SCANS)
            self._scanners[name] = method.maker(self.inputs, **method.options)
        return self._scanners[name]

    def odometry(self, name: str, scans: str) -> Follower:
        """Odometry by a key of `ODOMETRY`, made from `scans` if it is made from scans.

        Raises:
            InputError: unknown name, or see `Method`.
        """
        method = self._method("odometry", name, ODOMETRY)
        key = name, scans if method.scans else None
        if key not in self._followers:
            taken = (self.scanner(scans),) if method.scans else ()
            self._followers[key] = method.maker(self.inputs, *taken, **method.options)
        return self._followers[key]

    def pipeline(self, odometry: str, scans: str, endless: bool = False) -> Pipeline:
        """A pipeline by the names of its methods; `endless` as of `radarize.slam.backend.Slam`.

        Raises:
            InputError: see `odometry` and `scanner`.
        """
        slam = self.inputs.configuration.slam
        return Pipeline(self.odometry(odometry, scans), self.scanner(scans), slam, endless)

    def _method(self, what: str, name: str, known: dict[str, Method]) -> Method:
        recording, method = self.inputs.recording, _named(what, name, known)
        if recording is not None and not recording.has_samples and not (method.pictures or method.scans):
            wanted = f"{what} {PICTURED[what]}" if pictured(recording) else "a recording with /radar/adc"
            raise InputError(f"{recording.path}: has no raw samples, which {what} {name} needs, expected {wanted}")
        return method


def _named(what: str, name: str, known: dict[str, Method]) -> Method:
    if name not in known:
        raise InputError(f"{what} is {name!r}, expected one of {', '.join(known)}")
    return known[name]


def best_methods(radar: RadarConfig) -> tuple[dict[str, str], str]:
    """Odometry and scans of choice for a radar, and where these are classical ones, why."""
    chosen, why, weights = dict(BEST), [], Weights()
    for what, known in (("odometry", ODOMETRY), ("scans", SCANS)):
        try:
            for kind in known[BEST[what]].needed(radar):
                check(weights.of(kind), radar)
        except InputError as error:
            chosen[what] = CLASSICAL[what]
            why.append(str(error))
    return chosen, "; ".join(why)


def pace(odometry: str, radar: RadarConfig) -> int:
    """Every so many-th frame is enough for odometry: a network of turns was taught at a rate of its own, and with it
    odometry is no better where frames come more often. Without one, every frame counts.

    Raises:
        InputError: unknown name.
    """
    if "rotation" not in _named("odometry", odometry, ODOMETRY).networks:
        return 1
    taught = header_of(Weights().of("rotation")).grid
    return max(1, int(taught.frame_period / radar.frame_period * (1 + 1e-3))) if taught else 1


def find_task(kind: str) -> Task:
    """A network's training by name.

    Raises:
        InputError: there is none.
    """
    if kind not in TASKS:
        raise InputError(f"task is {kind!r}, expected one of: {', '.join(TASKS)}")
    place = TASKS[kind]
    return (load(place) if isinstance(place, str) else place)()


__all__ = [
    "BEST", "CLASSICAL", "ODOMETRY", "PICTURED", "SCANS", "TASKS", "Configuration", "Inputs", "Method", "Weights",
    "Workshop", "best_methods", "find_task", "pace",
]  # fmt: skip
