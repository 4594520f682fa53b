"""Files named in CONTRIBUTING.md and in the workflow exist."""

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]


def test_templates_and_their_tests_are_there():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    named = re.findall(r"`([\w./-]+/[\w./-]*)`", text) + re.findall(r"\]\(([\w./-]+)\)", text)
    assert len(named) > 20
    assert not [name for name in named if not name.startswith("../") and not (ROOT / name).exists()]


def test_the_workflow_runs_what_the_house_has():
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text())["jobs"]
    lines = [step["run"] for job in jobs.values() for step in job["steps"] if "run" in step]
    targets = {target for line in lines for target in re.findall(r"make (\w+)", line)}
    makefile = (ROOT / "Makefile").read_text()
    rules = re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)[1].split()
    assert {"lint", "docs", "lowest"} <= targets <= set(rules)
    assert ".ci/run" in lines
    named = re.findall(r"\btests/[\w/]+(?:\.py)?", makefile)
    assert named and all((ROOT / name).exists() for name in named)
