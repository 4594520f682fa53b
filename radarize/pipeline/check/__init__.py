"""Check a recording for the faults that its samples show: what is wrong, how sure, what corrects it."""
