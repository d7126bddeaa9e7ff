"""The HTTP API: it checks requests, reads and writes state, and streams events.

It decides nothing about convergence and never imports `plateau.service.monitor`. The reasons are in
docs/decisions/api.md.
"""
