"""The scenes of the paper, built by code."""
