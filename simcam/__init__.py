"""What the cameras see: a ray-cast stereo simulator of a lit pedestal with falling drops."""
