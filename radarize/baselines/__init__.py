"""Other people's methods, re-implemented from their papers, under the same conditions as Radarize's own.

| method | from | answers with |
|---|---|---|
| RadarHD (`radarhd`) | Prabhakara et al., "High resolution point clouds from mmWave radar", ICRA 2023 | scans |
| milliEgo (`milliego`) | Lu et al., "milliEgo: single-chip mmWave radar aided egomotion estimation via deep sensor fusion", SenSys 2020 | odometry |
| RNIN (`rnin`) | Chen et al., "RNIN-VIO: robust neural inertial navigation aided visual-inertial odometry in challenging scenes", ISMAR 2021 | odometry |
| Doppler RANSAC (`ransac`) | Doer and Trommer, "An EKF based approach to radar inertial odometry", MFI 2020 | velocity |

Networks have a width, of which 64 is the paper's; at that width their numbers of parameters are the papers'.
"""
