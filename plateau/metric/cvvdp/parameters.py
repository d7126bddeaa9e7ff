"""The fitted constants of ColorVideoVDP 0.5.7, the base model.

Channels are in the order sustained achromatic, RG, YV, transient achromatic; stills lack the last.

Names follow the paper's quantities; values are the authors' (see the package's docstring).
"""

from typing import Final

import numpy as np

#: Opponent colours, which are the channels of a still: achromatic, red–green, yellow–violet.
COLOURS: Final = 3
#: The channels of a video; the last one is the transient achromatic.
CHANNELS: Final = 4

#: CIE XYZ to the cones of CIE 2006, then to the opponent space DKL under D65.
XYZ_TO_LMS: Final = np.array(
    [
        [0.187596268556126, 0.585168649077728, -0.026384263306304],
        [-0.133397430663221, 0.405505777260049, 0.034502127690364],
        [0.000244379021663, -0.000542995890619, 0.019406849066323],
    ]
)
LMS_TO_DKL: Final = np.array(
    [[1.0, 1.0, 0.0], [1.0, -2.311130179947035, 0.0], [-1.0, -1.0, 50.977571328718781]]
)

#: Kernel of the pyramid; each level has half the size of the one before.
KERNEL: Final = (0.05, 0.25, 0.4, 0.25, 0.05)
#: Peak frequency of the bands after the first, over the Nyquist frequency of the finest.
BAND_FREQUENCY: Final = 0.3228
#: Frequencies in cycles per degree: the last band is at or below the first; the base is the second.
LEAST_FREQUENCY, BASE_FREQUENCY = 0.2, 0.1

#: Backgrounds are at least this, in cd/m², and contrasts at most this.
LEAST_BACKGROUND, GREATEST_CONTRAST = 0.01, 1000.0

#: Correction of the sensitivity in dB, and the gain of each channel's contrast.
SENSITIVITY_DB: Final = -0.2797423303127289
GAIN: Final = (1.0, 1.45, 1.0, 1.0)

#: Masking: the exponent of differences, and those of the masking contrasts.
DIFFERENCE_EXPONENT: Final = 2.264355182647705
MASKING_EXPONENTS: Final = (
    1.302622675895691,
    2.8885908126831055,
    3.6807713508605957,
    3.588787317276001,
)
#: log10 of the masker's gain, and the standard deviation of its blur in pixels.
MASKING_GAIN, MASKING_SIGMA = -0.7954971194267273, 3
#: log2 of the weights by which a row's channel masks a column's.
CROSS_CHANNEL: Final = (
    (-0.18950104713439941, -5.962151050567627, -4.31834602355957, -1.9321587085723877),
    (2.5655593872070312, 0.34406712651252747, -2.719646453857422, -0.4970424771308899),
    (3.8118371963500977, -1.0051705837249756, -0.5193376541137695, -0.5653647780418396),
    (-7.054771423339844, -5.527150630950928, -3.5106418132781982, -2.08804988861084),
)
#: log10 of the greatest difference.
GREATEST_DIFFERENCE: Final = 2.5642454624176025

#: Exponents of pooling over pixels, bands, channels and frames.
PIXEL_EXPONENT, BAND_EXPONENT, CHANNEL_EXPONENT, FRAME_EXPONENT = 2, 4, 4, 2
#: Weights of the channels, and those of the base band.
CHANNEL_WEIGHTS: Final = (1.0, 1.0, 1.0, 0.8081134557723999)
BASE_WEIGHTS: Final = (
    0.0036334486212581396,
    1.6627724170684814,
    4.11874532699585,
    25.25969886779785,
)
#: What a still is worth beside a video.
STILL_WEIGHT: Final = 0.577918291091919
#: Q to JOD: 10 - JOD_SCALE Q^JOD_EXPONENT, and a line below LINEAR_BELOW.
JOD_SCALE, JOD_EXPONENT, LINEAR_BELOW = 0.0439569391310215, 0.9302042722702026, 0.1

#: A temporal filter is as long as this, in seconds, and has an odd number of frames.
FILTER_S: Final = 0.25
#: At ω Hz a sustained channel responds by exp(-ω^b / s), the transient one, which peaks at 5 Hz, by
#: exp(-(ω^b - 5^b)² / s): the exponents b, and the s.
TEMPORAL_EXPONENTS: Final = (1.3314, 1.1196, 0.947901, 0.1898)
TEMPORAL_SPREADS: Final = (5.79336, 14.1255, 6.63661, 0.12314)
TRANSIENT_PEAK_HZ: Final = 5.0

#: What powers add to their argument, so that their slope is finite at 0.
EPSILON: Final = 1e-5
