"""Ways in: radar video by datagram, octets or recording; node events and target reports by JSON and MQTT."""
