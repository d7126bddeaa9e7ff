"""A renderer of images that are known, with noise of known statistics on every sample.

It needs nothing but numpy. What a farm, a rule or an estimate makes of its samples can be held
against what is true, and it costs far less than a path tracer.
"""
