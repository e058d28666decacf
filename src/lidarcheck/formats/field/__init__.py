"""Files of the field: bags, traces and rows of data sets, read frame by frame; packet files are recognised."""
