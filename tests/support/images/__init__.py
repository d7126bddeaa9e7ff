"""Images, and how tests look at them."""

from typing import Final

from plateau.metric import View

#: The paper's, for whose rules the figures of most tests are.
PAPER: Final = View(field_of_view_deg=45, white_luminance=100, ambient_lux=64)
