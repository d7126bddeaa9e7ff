"""How a process confines itself before it reads a scene: files, system calls, capabilities.

The render child and the probes of renderers use it; it knows neither.

The reasons are in docs/decisions/worker.md.
"""
