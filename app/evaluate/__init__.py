"""`airside evaluate`: runs the experiments of `pipeline.lab.evaluate` and tells what they found."""
