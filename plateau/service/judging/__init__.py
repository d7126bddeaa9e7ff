"""A job's merged image: added up from slices, judged by rules, and shown in pictures.

The API and the monitor both need it; it knows neither.

The reasons are in docs/decisions/merging.md.
"""
