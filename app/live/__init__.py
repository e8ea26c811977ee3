"""The live feed: pictures from the surface thread to any number of WebSocket clients, each at its own pace."""
