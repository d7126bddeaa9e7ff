"""Blender's Cycles as a renderer, by Blender's Python module `bpy`.

`bpy` is under the GNU General Public License 3, with which the Apache License 2.0 of these modules
is compatible. They are imported in render children alone, as all renderers are, and nothing of
Blender is part of Plateau.
"""
