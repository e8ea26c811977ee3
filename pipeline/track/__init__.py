"""The central tracker: radar plots, node events and target reports update one table of tracks."""
