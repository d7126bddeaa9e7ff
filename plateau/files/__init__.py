"""Files that commands read and write: packed scenes, image series, plots, folders of results."""
