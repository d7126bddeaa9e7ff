"""Denoising: in a process of its own, so that no other job of the monitor waits for it.

`job_image` is the image of one job and its tries. The monitor's side of the process is `process`,
the other side `child`; `oidn` is the library. What is asked and answered lives in
`plateau.service.judging.denoised`, the mathematics in `plateau.metric.blend`.
"""
