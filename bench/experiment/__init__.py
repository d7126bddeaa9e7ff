"""The paper's experiment, run on our own farm and judged against independent references."""
