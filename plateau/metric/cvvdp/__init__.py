"""ColorVideoVDP: how much worse a test image looks than a reference, on a given display.

The scale is that of just-objectionable differences (JOD): 10 where nobody sees a difference, and
one less where three of four people prefer the reference. This package is version 0.5.7, the base
model. Its kernels are compiled as in `plateau.metric.compiled`.

    model        ColorVideoVDP, the class to use
    display      what the screen shows: photometry and geometry
    light        code values to opponent colour (compiled)
    video        temporal channels of the frames of a video (compiled)
    percept      what a comparison needs of one image
    pyramid      levels of halved size (compiled)
    sensitivity  castleCSF from its table
    bands        contrast, masking and differences in a band (compiled)
    pooling      from differences to JOD
    parameters   the fitted constants

References
----------
R. K. Mantiuk, P. Hanji, M. Ashraf, Y. Asano and A. Chapiro, ColorVideoVDP: a visual difference
predictor for image, video and display distortions, ACM Transactions on Graphics 43(4), SIGGRAPH
2024. doi:10.1145/3658144

M. Ashraf, R. K. Mantiuk, A. Chapiro and S. Wuerger, castleCSF: a contrast sensitivity function of
color, area, spatiotemporal frequency, luminance and eccentricity, Journal of Vision 24(4), 2024.
doi:10.1167/jov.24.4.5

The fitted constants and the table of sensitivities are the authors' (`cvvdp` on PyPI, MIT License,
copyright 2024 Graphics and Displays group; the licence is in ``ColorVideoVDP.LICENSE``).
"""

from plateau.metric.cvvdp.display import DISPLAYS, Display, pixels_per_degree
from plateau.metric.cvvdp.model import ColorVideoVDP, Quality, video_jod
from plateau.metric.cvvdp.percept import LEAST_SIZE, Percept
from plateau.metric.cvvdp.video import mirrored

__all__ = [
    "DISPLAYS",
    "LEAST_SIZE",
    "ColorVideoVDP",
    "Display",
    "Percept",
    "Quality",
    "mirrored",
    "pixels_per_degree",
    "video_jod",
]
