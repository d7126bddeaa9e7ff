"""Checks of uploaded scenes, each in a process with limits."""
