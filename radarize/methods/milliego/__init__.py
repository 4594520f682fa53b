"""milliEgo (Lu et al., SenSys 2020): a sparse point cloud and an IMU."""

from radarize.methods.method import Method

_PLACE = "radarize.methods.milliego"
ODOMETRY = {"milliego": Method("milliEgo", f"{_PLACE}.odometry:MilliEgoOdometry", ("milliego",))}
TASKS = {"milliego": f"{_PLACE}.training:MilliEgo"}
