"""File formats that carry datagrams: pcap, pcapng, bare ASTERIX blocks, each also compressed."""
