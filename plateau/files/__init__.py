"""Files that commands read and write: packed scenes, image series, plots, result folders."""
