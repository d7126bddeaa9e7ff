"""`plateau dataset`: a recipe of many images, and the folder that they fill.

A recipe says what is rendered; a manifest says what is there. The two together say what is left to
do, so a run may be killed at any moment, and the next one goes on.
"""
