"""What `pip install radarize` leaves out, and who is missed by a command without it."""

#: Modules of the extras of pyproject.toml, as they are imported.
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
    """What to type for the extra that an import misses; None if the error is another, or the module nobody's."""
    module = (getattr(error, "name", None) or "").split(".")[0] if isinstance(error, ModuleNotFoundError) else ""
    for extra, modules in EXTRAS.items():
        if module in modules:
            return f"this needs {module}, which is not installed; type: pip install 'radarize[{extra}]'"
    return None
