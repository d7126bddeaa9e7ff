"""Images of points of a curve, made again from slices that a job kept."""
