"""The demonstration: a programme made on the spot, sent through broadcast codecs, received."""
