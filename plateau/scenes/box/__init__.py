"""The paper's first family: a closed box under a ceiling light."""
