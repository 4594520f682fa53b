"""The paper's pipeline as its published artefact runs it, quirks included, so that its data's users get comparable
numbers. `benchmarks/corrections.py` says what mending them is worth. It comes without weights."""

from radarize.methods.method import Method

_PLACE = "radarize.methods.published"
_KINDS = ("translation", "rotation", "segmentation")
ODOMETRY = {
    "published": Method("as published", f"{_PLACE}.making:odometry", ("published-translation", "published-rotation"))
}
SCANS = {"published": Method("as published", f"{_PLACE}.making:scans", ("published-segmentation",))}
TASKS = {f"published-{kind}": f"{_PLACE}.training:Published{kind.capitalize()}" for kind in _KINDS}
