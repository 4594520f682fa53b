"""All files that `python -m docs.reference` writes."""

import json
from pathlib import Path

from docs.reference import api, commands, configuration, fields, recording
from radarsim.schema import NAMES, schema

ROOT = Path(__file__).parents[2]
_NOTE = "<!-- Written by `python -m docs.reference`: edit the docstrings and help texts instead. -->\n\n"


def written() -> dict[str, str]:
    """Return the text of each file by its path in the repository."""
    schemas = {name: schema(name) for name in NAMES}
    pages = {
        "api": api.page(),
        "commands": commands.page(),
        "configuration": configuration.page(),
        "format": recording.page(),
        **{name: fields.page(name, found) for name, found in schemas.items()},
    }
    found = {f"docs/reference/{name}.md": _NOTE + text for name, text in pages.items()}
    return found | {f"scenes/schemas/{name}.json": json.dumps(each, indent=1) + "\n" for name, each in schemas.items()}
