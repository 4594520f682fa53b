"""Check a recording for faults that its samples show: the fault, the confidence, and the correction."""
