"""The paper's pipeline as its published artefact runs it, quirks included, so that its data's users get comparable
numbers. The default is `corrected`: what the physics asks for (`benchmarks/corrections.py` says what that is worth)."""
