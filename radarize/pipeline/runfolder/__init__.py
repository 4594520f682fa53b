"""The run folder: the result of the pipeline, or of SLAM on plain files. Only this package writes and reads it.

trajectory.tum        poses after SLAM; written last, so a folder that has it is complete
odometry.tum          poses of odometry alone
reference.tum         true poses, where they are known
map.pgm, map.yaml     occupancy, as ROS map_server reads it
scans.h5              scans and velocities, truth of them, heat maps of some frames (`SHAPES`)
run.json              recording, methods, settings, versions, timings
metrics.json          errors against the truth, written by `radarize evaluate`
"""

from radarize.pipeline.runfolder.occupancy import OccupancyMap
from radarize.pipeline.runfolder.reader import RunFolder, Scans
from radarize.pipeline.runfolder.writer import RunWriter

__all__ = ["OccupancyMap", "RunFolder", "RunWriter", "Scans"]
