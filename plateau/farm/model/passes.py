"""How a slice is divided into passes, whose films are added up in their order.

A pass is what a renderer renders with one seed. A renderer that renders a pass in parts can be
cancelled between them, and takes passes of any size. One that does it in one call needs short ones.
"""

#: Samples in the largest pass that is rendered in a single call: about a second of work on two
#: cores, so that a cancel is quick.
LARGEST_CALL_SAMPLES = 2**20

#: Spp of the largest pass that is rendered in parts. Within a pass, a pixel is added up in float32.
LARGEST_SPP = 64
#: Samples of such a pass have numbers below this one.
_SAMPLE_NUMBERS = 2**31

#: The most spp of a slice that has zones of the film.
MOST_SLICE_SPP = 512

#: Samples in the first pass of a job, whose film is shown while the others render.
GLIMPSE_SAMPLES = 2**18


def single_call_passes(slice_spp: int, largest: int) -> tuple[int, ...]:
    """Return the powers of two, descending and none above `largest`, that sum to `slice_spp`.

    Parameters
    ----------
    slice_spp : int
        Samples per pixel of a slice, at least 1.
    largest : int
        Upper limit of a pass in spp, at least 1.

    Examples
    --------
    >>> single_call_passes(25, 16)
    (16, 8, 1)
    >>> single_call_passes(25, 4)
    (4, 4, 4, 4, 4, 4, 1)
    """
    if slice_spp < 1 or largest < 1:
        raise ValueError(f"slice_spp {slice_spp} and largest {largest} must be at least 1")
    top = _floor_power_of_two(largest)
    whole, rest = divmod(slice_spp, top)
    small = (1 << bit for bit in reversed(range(rest.bit_length())) if rest >> bit & 1)
    return (top,) * whole + tuple(small)


def largest_single_call(pixels: int) -> int:
    """Return the largest power of two of spp whose samples stay within `LARGEST_CALL_SAMPLES`.

    Parameters
    ----------
    pixels : int
        Of the film.
    """
    return _floor_power_of_two(max(1, LARGEST_CALL_SAMPLES // pixels))


def passes_in_parts(slice_spp: int, pixels: int, *, is_first: bool) -> tuple[int, ...]:
    """Return the spp of the passes of a slice, for a renderer that renders a pass in parts.

    They are as few and as even as can be. The first slice of a job begins with a short one, so that
    its film can be shown soon.

    Parameters
    ----------
    slice_spp : int
        Samples per pixel of the slice, at least 1.
    pixels : int
        Of the film.
    is_first : bool
        Whether it is the first slice of its job.

    Examples
    --------
    >>> passes_in_parts(25, 256 * 256, is_first=False)
    (25,)
    >>> passes_in_parts(25, 256 * 256, is_first=True)
    (4, 21)
    >>> passes_in_parts(100, 256 * 256, is_first=False)
    (50, 50)
    """
    largest = min(LARGEST_SPP, _SAMPLE_NUMBERS // pixels)
    glimpse = min(largest, _floor_power_of_two(max(1, GLIMPSE_SAMPLES // pixels)))
    first = (glimpse,) if is_first and 2 * glimpse <= slice_spp else ()
    rest = slice_spp - sum(first)
    count = -(-rest // largest)
    each, more = divmod(rest, count)
    return first + (each + 1,) * more + (each,) * (count - more)


def _floor_power_of_two(value: int) -> int:
    return 1 << (value.bit_length() - 1)
