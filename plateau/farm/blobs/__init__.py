"""The blob store: scenes, partials, checkpoints and results, in a folder or in S3.

The package does not know what the blobs contain. docs/decisions/storage.md has the reasons.
"""
