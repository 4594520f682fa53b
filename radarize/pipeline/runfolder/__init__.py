"""The run folder: what the pipeline, or SLAM on plain files, made of its input, written and read here alone.

trajectory.tum        poses after SLAM; a folder that has it is whole
odometry.tum          poses of odometry alone
reference.tum         true poses, where they are known
map.pgm, map.yaml     occupancy, as ROS map_server reads it
scans.h5              scans and velocities, what is true of them, heat maps of a few frames (`SHAPES`)
run.json              recording, methods, settings, versions, timings
metrics.json          figures against the truth, once `radarize evaluate` has made them
"""

from radarize.pipeline.runfolder.occupancy import OccupancyMap
from radarize.pipeline.runfolder.reader import RunFolder, Scans
from radarize.pipeline.runfolder.writer import RunWriter

__all__ = ["OccupancyMap", "RunFolder", "RunWriter", "Scans"]
