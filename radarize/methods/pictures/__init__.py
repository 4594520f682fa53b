"""Points like a lidar's, and turns, from polar pictures (`radarize.polar`), by networks that saw simulation alone."""

TASKS = {
    "pictures": "radarize.methods.pictures.training:Pictures",
    "picture-turns": "radarize.methods.pictures.turns:PictureTurns",
}
