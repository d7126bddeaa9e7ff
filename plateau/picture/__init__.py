"""A merged image: added up from slices, judged by rules, denoised, and shown in pictures.

The API, the monitor, the study and the commands that judge image files need it; it knows none.
The reasons are in docs/decisions/merging.md.
"""
