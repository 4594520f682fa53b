"""RNIN (Chen et al., ISMAR 2021): an IMU alone."""

from radarize.methods.method import Method

_PLACE = "radarize.methods.rnin"
ODOMETRY = {"rnin": Method("RNIN", f"{_PLACE}.odometry:RninOdometry", ("rnin",))}
TASKS = {"rnin": f"{_PLACE}.training:Rnin"}
