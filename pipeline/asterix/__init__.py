"""ASTERIX: the octet formats that surveillance sensors speak."""
