"""OCULIST: a museum case of engraved stamps, bronze instruments, mosaic and woven cloth."""
