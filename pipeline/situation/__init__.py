"""The situation on the runways: who is where, and who has passed a holding position; computed once for all rules."""
