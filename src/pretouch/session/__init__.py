"""One run of an arm and its skin: what is checked first, the guided push, the loop, and the way to rest."""
