"""HTTP as the API uses it: the server, connections, caching, headers and files.

Nothing here knows a job.
"""
