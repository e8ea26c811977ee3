"""What a real airport would send: recorded traffic turned into truth, and truth into video, events, reports."""
