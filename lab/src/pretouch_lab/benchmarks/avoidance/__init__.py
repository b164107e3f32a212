"""Ways to keep clear of people and objects, held against each other in the same scenes."""
