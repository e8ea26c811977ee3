"""What a source's clock is worth: its offset to the time of arrival, and what is taken, corrected or refused for it."""
