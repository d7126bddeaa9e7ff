"""Renderers, each a package: what a render child hosts."""
