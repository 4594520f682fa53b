"""Points like a lidar's, and turns, from polar pictures (`radarize.polar`), by networks that saw simulation alone."""

from radarize.methods.method import Method

ODOMETRY = {
    "pictures": Method(
        "scan matching, turns by a network",
        "radarize.methods.pictures.odometry:odometry",
        ("picture-turns",),
        scans=True,
    )
}
SCANS = {
    "pictures": Method(
        "network on polar pictures", "radarize.methods.pictures.scans:PictureScans", ("pictures",), pictures=True
    )
}
TASKS = {
    "pictures": "radarize.methods.pictures.training:Pictures",
    "picture-turns": "radarize.methods.pictures.turns:PictureTurns",
}
