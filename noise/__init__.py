"""What radiation and the sensor add to a clip: the only randomness of the images."""
