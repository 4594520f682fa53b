"""The paper's pipeline as its published artefact runs it, quirks included, so that its data's users get comparable
numbers. `benchmarks/corrections.py` says what mending them is worth. It comes without weights."""
