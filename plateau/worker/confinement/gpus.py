"""What CUDA and OptiX open of NVIDIA's driver: its devices, and what it says of itself.

The list is of what a child was seen to open on an H200 with driver 580, and of the same things
elsewhere. Beside that the driver opens a socket of packets, to ask for a server of MPS and to share
memory between processes; without one `cuInit` fails.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from plateau.worker.confinement import landlock

#: The devices: of each GPU, of the driver, of unified memory; of Windows below WSL.
_DEVICES: Final = ("nvidia*", "nvidia-caps/*", "dxg", "nvmap", "nvhost*", "nvgpu/*/*")
#: What the driver reads of the machine, and its own data. Libraries lie where all libraries do.
_SAID: Final = (
    *("/proc/driver/nvidia", "/proc/driver/nvidia-uvm", "/proc/devices", "/proc/modules"),
    *("/sys/bus/pci", "/sys/class/drm", "/sys/module", "/sys/devices", "/proc/version"),
    *("/usr/share/nvidia", "/usr/local/nvidia", "/usr/lib/wsl"),
    *("/etc/nvidia", "/etc/OpenCL", "/etc/nvidia-container-runtime"),
)


def driver_files() -> Iterator[tuple[Path, int]]:
    """Yield the paths that a process needs that renders on a GPU, each with its rights."""
    for pattern in _DEVICES:
        for device in Path("/dev").glob(pattern):
            if not device.is_dir():
                yield device, landlock.USE_DEVICE
    for path in _SAID:
        yield Path(path), landlock.READ
    yield Path("/proc/self/task"), landlock.CHANGE  # the driver names its threads
