"""Methods of other publications, and comparisons with them. They are plug-ins: the rest of the package works without.

| folder | odometry | scans | source |
|---|---|---|---|
| `ransac` | doppler-ransac | | Doer and Trommer, REVE, 2020 |
| `scan_matching` | scan-matching | | scan matching, on the scans of any method |
| `milliego` | milliego | | Lu et al., milliEgo, SenSys 2020 |
| `rnin` | rnin | | Chen et al., RNIN-VIO, ISMAR 2021 |
| `radarhd` | | radarhd | Prabhakara et al., RadarHD, ICRA 2023 |
| `pictures` | pictures | pictures | networks trained in simulation, on RadarHD's pictures |
| `published` | published | published | Radarize as in its published artefact, known errors included; without weights |

`walks` reads RadarHD's real walks, and `real` is the benchmark on them. Networks have a width; with width 64 they have
as many parameters as the papers' networks.
"""
