"""A job's report: one self-contained page."""
