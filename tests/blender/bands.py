"""Renders a Blender file whole and in bands of all kinds, and says which differ."""

import random
import sys
from pathlib import Path

import numpy as np

from plateau.cycles.renderer import Renderer
from plateau.worker.renderers.contract import Load

HEIGHTS = (1, 37, 48, 157, 180, 211, 540, 1079, 1080)
BANDS = 40  #: of each height


def main(blend: Path) -> None:
    draw = random.Random(5)
    renderer = Renderer("cpu", 2)
    for height in HEIGHTS:
        parameters = {"width": "8", "height": str(height)}
        renderer.load(Load(folder=str(blend.parent), entry=blend.name, parameters=parameters))
        one = renderer._one
        assert one is not None
        whole = renderer._band(one, 0, height, 1, 0)
        for _ in range(BANDS):
            top = draw.randrange(height)
            rows = draw.randint(1, height - top)
            band = renderer._band(one, top, rows, 1, 0)
            if not np.array_equal(band, whole[top : top + rows]):
                print(f"{rows} rows from {top} of {height} differ")
    print("done")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
