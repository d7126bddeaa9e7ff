"""Image files: EXR and PNG.

How images are merged and judged is in `plateau.picture`.
"""
