"""Conversion of the artefact's weights (``transnet18.pth``, ``eca_rotnet18_135.pth``, ``unet.pth``, by `torch.save`)
from and to this package's: layers have the same shapes, but different names.

| here | artefact |
|---|---|
| resnet.stem.0, .1 | conv1, bn1 |
| resnet.stages.S.B.body.0, .1, .3, .4 | layer(S + 1).B.conv1, .bn1, .conv2, .bn2 |
| resnet.stages.S.B.body.5.mix | layer(S + 1).B.channel.conv1 (rotation) |
| resnet.stages.S.B.shortcut | layer(S + 1).B.shortcut (rotation), .downsample (translation) |
| resnet.head | fc (translation); .0, .1, .3 are linear, fc.fcs.0, fc.fcs.2 (rotation) |
| unet.down.0; unet.down.L | inc.double_conv; downL.maxpool_conv.1.double_conv |
| unet.up.L.grow, .mix | up(L + 1).up, up(L + 1).conv.double_conv |
| unet.head | outc.conv, whose classes are occupied, free instead of free, occupied |

In the artefact, all names of the translation network start with ``resnet18.``.
"""

import re
from pathlib import Path

import torch
from torch import Tensor

from radarize.baselines.published.training import PublishedRotation, PublishedSegmentation, PublishedTranslation
from radarize.io.errors import InputError, explained
from radarize.io.replacing import replacing
from radarize.learning.features.grid import MapGrid
from radarize.learning.nets.weights import Header, Network, header_of, load
from radarize.learning.nets.weights import save as save_network
from radarize.radar.config import RadarConfig

_TASKS = {task.network.kind: task for task in (PublishedTranslation, PublishedRotation, PublishedSegmentation)}
#: Names of the artefact's networks and their classes by kind.
MODELS = {
    "translation": ("transnet18", "ResNet18"), "rotation": ("eca_rotnet18_135", "ECAResNet18"),
    "segmentation": ("unet", "UNet"),
}  # fmt: skip
_BODY = {"0": "conv1", "1": "bn1", "3": "conv2", "4": "bn2", "5.mix": "channel.conv1"}
_HEAD = {"0": "linear", "1": "fc.fcs.0", "3": "fc.fcs.2"}


def artefact_name(kind: str, name: str) -> str | None:
    """Return the artefact's name of a tensor of a network; None if the artefact has no such tensor.

    Example:
        >>> artefact_name("rotation", "resnet.stages.0.1.body.5.mix.weight")
        'layer1.1.channel.conv1.weight'
    """
    short = "downsample" if kind == "translation" else "shortcut"
    rules = [
        (r"resnet\.stem\.0", lambda m: "conv1"),
        (r"resnet\.stem\.1", lambda m: "bn1"),
        (r"resnet\.stages\.(\d)\.(\d)\.body\.(5\.mix|\d)", lambda m: f"layer{int(m[1]) + 1}.{m[2]}.{_BODY[m[3]]}"),
        (r"resnet\.stages\.(\d)\.(\d)\.shortcut", lambda m: f"layer{int(m[1]) + 1}.{m[2]}.{short}"),
        (r"resnet\.head\.(\d)", lambda m: _HEAD[m[1]]),
        (r"resnet\.head", lambda m: "fc"),
        (r"unet\.down\.0", lambda m: "inc.double_conv"),
        (r"unet\.down\.(\d)", lambda m: f"down{m[1]}.maxpool_conv.1.double_conv"),
        (r"unet\.up\.(\d)\.grow", lambda m: f"up{int(m[1]) + 1}.up"),
        (r"unet\.up\.(\d)\.mix", lambda m: f"up{int(m[1]) + 1}.conv.double_conv"),
        (r"unet\.head", lambda m: "outc.conv"),
    ]
    for pattern, other in rules:
        if found := re.match(rf"{pattern}(?=\.)", name):
            return ("resnet18." if kind == "translation" else "") + other(found) + name[found.end() :]
    return None


def _swapped(name: str, values: Tensor) -> Tensor:
    """Exchange the two classes of the U-Net's head, whose order differs."""
    return values.flip(0) if name.startswith("unet.head") else values


def read_artefact(path: str | Path, kind: str, config: RadarConfig) -> tuple[Network, Header]:
    """Read a network trained by the artefact.

    Args:
        path: file of weights, ``.pth``.
        kind: ``translation``, ``rotation`` or ``segmentation``.
        config: radar configuration of the maps that the network will read.

    Raises:
        InputError: no such file, or not the weights of that network.
    """
    path, task = Path(path), _TASKS[kind]
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected weights (.pth)")
    with explained(f"{path}: is no file of weights of the artefact"):
        theirs = torch.load(path, map_location="cpu", weights_only=True)["model_state_dict"]
    header = Header(
        kind=kind, setting="published", frames=2 if kind == "rotation" else 1, maps=task.maps, width=64,
        grid=MapGrid.of(config, task.maps[0], task.network.maker),
        spacings=tuple(range(1, 5)) if kind == "rotation" else (1,), data=str(path.name),
    )  # fmt: skip
    net = task.network(header.frames, header.maps, header.width)
    own = net.state_dict()
    with explained(f"{path}: has not the weights of the artefact's network for {kind}"):
        for name in own:
            if other := artefact_name(kind, name):
                own[name] = _swapped(name, theirs[other])
        if left := theirs.keys() - {artefact_name(kind, name) for name in own}:
            raise ValueError(f"{sorted(left)[0]} is unknown")
        net.load_state_dict(own)
    return net.eval(), header


def import_artefact(source: str | Path, kind: str, config: RadarConfig, output: str | Path) -> Path:
    """Convert a network trained by the artefact to this package's ``published-KIND.safetensors`` (float16).

    Example:
        >>> import_artefact("unet.pth", "segmentation", rz.load("walk.h5").config, "published-segmentation.safetensors")
    """
    return save_network(*read_artefact(source, kind, config), Path(output))


def export_artefact(source: str | Path, output: str | Path) -> Path:
    """Convert a network of ``published`` to a ``.pth`` that the artefact's programs load.

    Args:
        source: ``published-KIND.safetensors`` of width 64, as written by `radarize train published-KIND --width 64`.

    Raises:
        InputError: another network, or a file that cannot be written.
    """
    source, output = Path(source), Path(output)
    header = header_of(source)
    if header.setting != "published" or header.width != 64:
        raise InputError(
            f"{source}: is a {header.setting} network for {header.kind} of width {header.width}, expected a published "
            "one of width 64"
        )
    net, _ = load(source, _TASKS[header.kind].network)
    values = {}
    for name, tensor in net.state_dict().items():
        if other := artefact_name(header.kind, name):
            values[other] = _swapped(name, tensor).contiguous()
    name, model = MODELS[header.kind]
    outputs = {"translation": {"n_outputs": 2}, "rotation": {"n_outputs": 1}, "segmentation": {"n_classes": 2}}
    about = {"n_channels": header.frames * len(header.maps), **outputs[header.kind]}
    content = {"model_name": name, "model_type": model, "model_kwargs": about, "model_state_dict": values}
    with replacing(output) as part:
        torch.save(content, part)
    return output
