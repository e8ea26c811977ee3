"""The situation on the runways: who is where, who has passed a holding position, who is seen twice; for all rules."""
