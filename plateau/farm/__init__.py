"""The contract between Plateau's processes: jobs, slices, states, queue, blobs and EXR files."""
