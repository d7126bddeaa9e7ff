"""How a process shuts itself in before a scene is in it: files, system calls, capabilities.

The render child and the probes of renderers use it; it knows neither.
"""
