"""Video to detections: each file is a method; `pipeline.contracts.detect` says what all of them keep to."""
