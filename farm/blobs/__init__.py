"""The blob store: scenes, partials, checkpoints and results, in a folder or in S3.

What the blobs contain is not known here.

The reasons are in docs/decisions/blobs.md.
"""
