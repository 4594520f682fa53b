"""Which types of path fill the cells of a range-azimuth map: before the first surface, at it, and behind it."""

import argparse

import numpy as np

from benchmarks.results import Data, Page, script, tracked, walked
from radarize.radar.presets import PRESETS
from radarsim.motion.walk import Walk
from radarsim.propagation.path_types import PathType
from radarsim.scenario import Scenario
from radarsim.sensors.causes import CAUSES
from radarsim.sensors.ghosts import NOISE, Ghosts
from radarsim.sensors.scan import Cell, Occupancy
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]
SCENES = ("office", "buildings/a", "buildings/c")
#: Where a cell lies, by its state in the horizontal plane.
WHERE = {"before the first surface": Cell.FREE, "at it": Cell.SURFACE, "behind it": Cell.UNKNOWN}


@script("Types of paths, by place", frames=(12, "of each walk"), seed=(1, "of walks and worlds"))
def main(options: argparse.Namespace) -> Page:
    rows, walks = [], []
    for name in tracked(SCENES, "scenes"):
        scene = Scene.load(name)
        scenario = Scenario(scene, Walk("handheld", 30.0).through(scene, options.seed), CONFIG, seed=options.seed)
        frames = scenario.frames(np.linspace(2.0, 28.0, options.frames))
        types = Ghosts(scenario).observe(frames)["truth/cause"]
        states = Occupancy(scenario).observe(frames)["truth/occupancy"]
        heard = (types != NOISE) & (types != CAUSES.index("leakage"))
        for where, state in WHERE.items():
            here = types[heard & (states == state)]
            shares = {f"{kind.name.lower()} %": 100 * np.mean(here == kind) for kind in PathType}
            rows.append({"scene": name, "cells": where, "number": len(here), **shares})
        walks.append(walked(name, options.seed, scenario.motion))
    return Page(
        rows,
        data=Data("handheld walks", tuple(walks), options.seed),
        notes=("Shares of the cells above the noise whose strongest paths are of a type; leakage is left out.",),
    )
