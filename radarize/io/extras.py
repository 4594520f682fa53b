"""Optional dependencies that `pip install radarize` leaves out, and the message when a command lacks one."""

#: Import names of the modules of each extra in pyproject.toml.
EXTRAS = {
    "sim": {
        "contourpy", "drjit", "llvmlite", "mapbox_earcut", "mitsuba", "open3d", "rtree", "sionna", "torchmetrics",
        "trimesh",
    },
    "ray": {"ray"},
    "viewer": {"foxglove", "rerun"},
    "onnx": {"onnx", "onnxscript"},
}  # fmt: skip


def lacking(error: BaseException) -> str | None:
    """Return which extra to install for a failed import; None for another error or an unknown module."""
    module = (getattr(error, "name", None) or "").split(".")[0] if isinstance(error, ModuleNotFoundError) else ""
    for extra, modules in EXTRAS.items():
        if module in modules:
            return f"this needs {module}, which is not installed; type: pip install 'radarize[{extra}]'"
    return None
