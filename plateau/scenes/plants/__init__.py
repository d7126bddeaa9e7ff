"""The paper's fourth family: a garden corner of many instances and masks under sun and sky."""
