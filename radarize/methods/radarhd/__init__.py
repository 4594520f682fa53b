"""RadarHD (Prabhakara et al., ICRA 2023): pictures like a lidar's."""

from radarize.methods.method import Method

_PLACE = "radarize.methods.radarhd"
SCANS = {"radarhd": Method("RadarHD", f"{_PLACE}.scans:scans", ("radarhd",))}
TASKS = {"radarhd": f"{_PLACE}.training:RadarHd", "radarhd-pictures": f"{_PLACE}.pictures:RadarHdPictures"}
