"""What a part of each verb keeps to, one file a verb. Parts, tracker and chain import this floor, never one another."""
