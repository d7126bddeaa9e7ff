"""Jobs by zones, replayed from recorded slices: what an allocation of samples saves."""
