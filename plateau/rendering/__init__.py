"""`plateau.render`: a scene to its image, from Python."""
