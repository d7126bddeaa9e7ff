"""The render child: a process that shuts itself in, and renders what its supervisor asks for.

Which renderer it hosts is in `plateau.worker.renderers`.
"""
