"""Radarize's networks, alone and together with least squares."""

from radarize.methods.method import Method

_PLACE = "radarize.methods.radarize"
ODOMETRY = {
    "fused": Method("networks and Doppler", f"{_PLACE}.making:fused", ("translation", "rotation"), whole=("rotation",)),
    "learned": Method("networks", f"{_PLACE}.making:learned", ("translation", "rotation")),
}
SCANS = {
    "segmentation": Method("segmentation network, first echo", f"{_PLACE}.making:segmentation", ("segmentation",)),
    "segmentation-alone": Method(
        "segmentation network alone", f"{_PLACE}.making:segmentation", ("segmentation",), options={"first": False}
    ),
}
TASKS = {
    "translation": f"{_PLACE}.training:Translation",
    "rotation": f"{_PLACE}.training:Rotation",
    "segmentation": f"{_PLACE}.training:Segmentation",
}
