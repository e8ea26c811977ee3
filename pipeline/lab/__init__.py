"""The laboratory: simulation, measurement and the experiments. Nothing in `pipeline/` outside it imports it."""
