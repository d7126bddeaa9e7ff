"""How many samples a pass may have, and how passes add up to a slice.

A pass is one Mitsuba render call. Its size is a power of two, small enough that a cancel is quick.
"""

#: Samples in the largest pass: about a second of work on two cores, so that a cancel is quick.
LARGEST_PASS_SAMPLES = 2**20

#: LLVM variants: spp of the largest pass. Dr.Jit renders packets of 4 lanes (NEON, SSE), 8 (AVX) or
#: 16 (AVX-512), and how packets are dealt to threads depends on their number. A pixel that does not
#: fit one packet is summed in the order in which threads finish: with 9 threads, passes of 32 spp
#: over 40×24 pixels differed in their last bits from one to the next. Small passes cost little:
#: 64×64 rendered 1.8 million samples/s in passes of 4 spp and 2.2 in passes of 16, larger films as
#: many either way (Cornell box, two cores).
LLVM_LARGEST_SPP = 4


def largest_pass(width: int, height: int) -> int:
    """Return the largest power of two of spp whose samples over the film stay within 2**20.

    Parameters
    ----------
    width, height : int
        Film size in pixels.

    Returns
    -------
    int
        Samples per pixel, at least 1.
    """
    return _floor_power_of_two(max(1, LARGEST_PASS_SAMPLES // (width * height)))


def passes(slice_spp: int, largest: int) -> tuple[int, ...]:
    """Return the powers of two, descending and none above `largest`, that sum to `slice_spp`.

    Powers of two because a JIT render call of any other count spreads pixels over packets, whose
    sums race between threads: their last bits would be up to chance (see `LLVM_LARGEST_SPP`).

    Parameters
    ----------
    slice_spp : int
        Samples per pixel of a slice, at least 1.
    largest : int
        Upper limit of a pass in spp, at least 1.

    Examples
    --------
    >>> passes(25, 16)
    (16, 8, 1)
    >>> passes(25, 4)
    (4, 4, 4, 4, 4, 4, 1)
    """
    if slice_spp < 1 or largest < 1:
        raise ValueError(f"slice_spp {slice_spp} and largest {largest} must be at least 1")
    top = _floor_power_of_two(largest)
    whole, rest = divmod(slice_spp, top)
    small = (1 << bit for bit in reversed(range(rest.bit_length())) if rest >> bit & 1)
    return (top,) * whole + tuple(small)


def _floor_power_of_two(value: int) -> int:
    return 1 << (value.bit_length() - 1)
