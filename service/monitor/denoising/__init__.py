"""Denoising: in a process of its own, so that no other job of the monitor waits for it.

The monitor's side is `process`, the other side `child`; `oidn` is the library. What is asked and
answered lives in `plateau.service.judging.denoised`, the mathematics in `plateau.metric.blend`.
"""
