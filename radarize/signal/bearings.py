"""Bearings of scans."""

import numpy as np

#: Bearings of a scan: 88 columns of 1 deg, -44...+43 deg, left positive, rad (the paper's field of view).
BEARINGS = np.radians(np.arange(-44.0, 44.0))
