"""A process of the monitor's for work that would hold up its jobs.

`process` is the monitor's side, `child` the other; `parts` is what goes between them.
"""
