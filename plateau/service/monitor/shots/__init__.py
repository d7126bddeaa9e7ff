"""Looks at shots, each in a process of its own: when, what of, and what they say to the frames."""
