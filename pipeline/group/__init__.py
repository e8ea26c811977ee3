"""Several plots, or several tracks, of one target: which they are, and where and how large that target is."""
