"""Farms that come and go: one command starts workers by Slurm or Ray, and gives the nodes back.

There is no second scheduler here. The command's own machine has Redis, the API and the monitor, as
without an engine; an engine starts ordinary workers on other machines, which lease slices as ever.

An engine is found by an entry point of the group `plateau.engines`; `contract` says what it is.
`fleet` keeps as many workers as were asked for, `front` tells nodes where the command's machine is,
and `node` is what runs on them.
"""
