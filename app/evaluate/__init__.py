"""`airside evaluate`: runs the experiments of `pipeline.evaluate` and tells what they found, on screen and on paper."""
