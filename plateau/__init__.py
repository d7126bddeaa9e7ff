"""Plateau's front door: the command line and the Python client."""
