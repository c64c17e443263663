"""Many shapes: which files are drawn and where to, by whom, and what became of each."""
