"""Denoising: in a process of its own, so that no other job of the monitor waits for it.

The monitor's side of the process is `process`, the other side `child`; `oidn` is the library. What
is asked and answered is in `plateau.picture.denoised`, the mathematics in `plateau.metric.blend`.
"""
