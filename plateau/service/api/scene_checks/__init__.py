"""Checks of uploaded scenes, in processes with limits."""
