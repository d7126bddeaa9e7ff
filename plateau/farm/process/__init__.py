"""What every process of a farm needs: settings, logs, signals, and the operating system's calls.

Nothing here knows a job.
"""
