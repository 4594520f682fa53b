"""Ray-traced simulation of the IWR1843 radar in indoor meshes, written as raw int16 I/Q."""
