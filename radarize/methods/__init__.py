"""Ways to odometry and scans, a folder each: estimator, network, labels and training stand together.

| folder | odometry | scans | source |
|---|---|---|---|
| `radarize` | fused, learned | segmentation, segmentation-alone | Radarize, MobiSys 2024, and what physics asks for |
| `doppler` | doppler | first-echo, elevation-aware, cfar, threshold | least squares; no networks |
| `ransac` | doppler-ransac | | Doer and Trommer, REVE, 2020 |
| `scan_matching` | scan-matching | | scans alone, whatever they are made with |
| `milliego` | milliego | | Lu et al., milliEgo, SenSys 2020 |
| `rnin` | rnin | | Chen et al., RNIN-VIO, ISMAR 2021 |
| `radarhd` | | radarhd | Prabhakara et al., RadarHD, ICRA 2023 |
| `published` | published | published | Radarize as its artefact does it, quirks included; comes without weights |

A folder's ``__init__`` says what it adds: `Method` entries in ``ODOMETRY`` and ``SCANS``, and in ``TASKS`` where the
trainings of its networks stand. Networks have a width, of which 64 is the papers'; at that width their numbers of
parameters are the papers'.
"""
