"""Other people's methods, re-implemented from their papers, under the same conditions as Radarize's own.

| method | network | what it sees | in use | answers with |
|---|---|---|---|---|
| RadarHD | `radarhd` | range-azimuth maps | `scans` | scans |
| milliEgo | `milliego` | `panorama` of sparse points, `inertial` | `odometry` | odometry |
| RNIN | `rnin` | `inertial` | `odometry` | odometry |
| Doppler RANSAC (REVE) | | sparse points | `ransac` | velocity |

`tasks` trains them. Each file names its paper. Networks have a width, of which 64 is the paper's; at that width their
numbers of parameters are the papers'.
"""
