"""Coverage of a skin: the postures it is averaged over, and the study that holds it against the simulation."""
