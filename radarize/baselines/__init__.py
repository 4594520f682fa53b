"""Methods of other publications, and comparisons with them: plug-ins, which the rest of the package runs without.

| folder | odometry | scans | source |
|---|---|---|---|
| `ransac` | doppler-ransac | | Doer and Trommer, REVE, 2020 |
| `scan_matching` | scan-matching | | scans alone, whatever they are made with |
| `milliego` | milliego | | Lu et al., milliEgo, SenSys 2020 |
| `rnin` | rnin | | Chen et al., RNIN-VIO, ISMAR 2021 |
| `radarhd` | | radarhd | Prabhakara et al., RadarHD, ICRA 2023 |
| `pictures` | pictures | pictures | RadarHD's pictures, by networks trained in simulation |
| `published` | published | published | Radarize as its artefact does it, quirks included; comes without weights |

`walks` reads RadarHD's real walks, `real` is the benchmark on them. Networks have a width, of which 64 is the papers';
at that width their numbers of parameters are the papers'.
"""
