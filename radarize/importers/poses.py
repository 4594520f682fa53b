"""True poses that come along with a capture."""

from pathlib import Path

from radarize.recording import Product
from radarize.tum import read_tum


def pose_products(path: Path) -> dict[str, Product]:
    """The poses of a TUM file as data sets of a recording, at their own times."""
    times, poses = read_tum(path)
    return {
        "truth/time": Product(times, "s", f"stamps of the poses of {path.name}"),
        "truth/pose": Product(poses, "m; x y z qx qy qz qw", "sensor in the world"),
    }
