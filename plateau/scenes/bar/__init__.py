"""The paper's first family: a bar in the evening, with indirect light, glass and metal."""
