"""Classical methods, for any radar: Doppler least squares and a local map; echoes of Capon's range-azimuth map."""

from radarize.methods.method import Method

_PLACE = "radarize.methods.doppler.making"
ODOMETRY = {"doppler": Method("Doppler least squares", f"{_PLACE}:doppler")}
SCANS = {
    name: Method(title, f"{_PLACE}:scans", options={"method": name})
    for name, title in (
        ("elevation-aware", "elevation-aware first echo"),
        ("first-echo", "first echo"),
        ("cfar", "CFAR"),
        ("threshold", "threshold"),
    )
}
