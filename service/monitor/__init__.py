"""The monitor: it owns jobs while they run, and ends them.

It never imports `plateau.service.api`; what both need is in `plateau.service.judging`.
"""
