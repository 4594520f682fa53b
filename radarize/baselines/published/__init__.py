"""The paper's pipeline as in its published artefact, known errors included, for results comparable with the paper's. It
comes without weights."""
