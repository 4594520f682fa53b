"""The Radarize data set as its archive has it: a folder of ROS bags, imported as a data set with the paper's splits.

The archive (Zenodo record 11093859) has bags PLATFORM_BUILDING_PLACE.bag, such as ``cart_csl_upper_0.bag``. Truth is
the tracking camera's odometry; the label of segmentation comes from the depth camera. The paper's own reference is SLAM
on both.
"""

import json
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.hdf5 import open_hdf5
from radarize.io.importers import import_recording
from radarize.io.replacing import write_whole
from radarize.io.yamlfile import read_beside

PLATFORMS = {"walk": "handheld", "cart": "cart", "bot": "robot"}
#: The paper's buildings by the archive's words.
BUILDINGS = {"sc": "A", "csl": "B", "ece": "C", "beckman": "D"}
_NAME = re.compile(rf"({'|'.join(PLATFORMS)})_({'|'.join(BUILDINGS)})_.+")
_PARTS = {"t": "train", "v": "validation", "e": "test"}
#: Of the splits by platform and by building, whose lists are not published, every tenth recording of the training
#: part validates.
_EVERY = 10
Members = dict[str, list[str]]


def bags(folder: Path) -> list[Path]:
    """The archive's bags in a folder, by name; none of a folder of anything else."""
    return sorted(path for path in folder.glob("*.bag") if _NAME.fullmatch(path.stem))


def import_archive(folder: Path, output: Path, progress: Callable[[int, int], None]) -> Path:
    """Import the archive's bags and write ``dataset.json``; bags that are imported already are not again.

    Args:
        folder: of bags.
        output: folder of recordings, one for each bag.
        progress: called with (bags done, bags in all).

    Returns:
        `output`.

    Raises:
        InputError: no bag of the archive's, or none that can be read.
    """
    found = bags(folder)
    if not found:
        raise InputError(f"{folder}: holds no bags of the Radarize data set, expected such as cart_csl_upper_0.bag")
    output.mkdir(parents=True, exist_ok=True)
    failed: list[InputError] = []
    for done, bag in enumerate(found):
        progress(done, len(found))
        try:
            _import(bag, output / f"{bag.stem}.h5")
        except InputError as error:
            failed.append(error)
    names = [bag.stem for bag in found if (output / f"{bag.stem}.h5").exists()]
    if not names:
        raise failed[0]
    about = {"specification": {"name": "Radarize data set", "splits": KINDS}, "splits": splits(names)}
    about["failed"] = [str(error) for error in failed]
    write_whole(output / "dataset.json", json.dumps(about, indent=1) + "\n")
    progress(len(found), len(found))
    return output


def _import(bag: Path, output: Path) -> None:
    if output.exists():
        return
    platform, building = bag.stem.split("_")[:2]
    part = output.with_suffix(".part.h5")
    with suppress(FileNotFoundError):
        part.unlink()
    import_recording(bag, part)
    with open_hdf5(part, mode="r+") as file:
        file.attrs["platform"], file.attrs["scene"] = PLATFORMS[platform], BUILDINGS[building]
    part.rename(output)


#: Kinds of the splits by name.
KINDS = {name: {"kind": name} for name in ("random", "platform", "building")}


def splits(names: list[str]) -> dict[str, Members]:
    """Splits by name: the artefact's five random ones, trained on handheld alone, and with A, B or C held out.

    Args:
        names: of the recordings; those that the artefact does not list are in no random split.
    """
    listed = read_beside(__file__)
    words = {name: name.split("_") for name in names}
    found = {
        f"random-{k}": {part: [n for n in names if listed.get(n, "-----")[k] == code] for code, part in _PARTS.items()}
        for k in range(5)
    }
    found["platform"] = _held_out(names, {name for name in names if words[name][0] != "walk"})
    for word, letter in list(BUILDINGS.items())[:3]:
        found[f"building-{letter}"] = _held_out(names, {name for name in names if words[name][1] == word})
    return found


def _held_out(names: list[str], tested: set[str]) -> Members:
    training = [name for name in names if name not in tested]
    return {
        "train": [name for k, name in enumerate(training) if (k + 1) % _EVERY],
        "validation": training[_EVERY - 1 :: _EVERY],
        "test": sorted(tested),
    }
