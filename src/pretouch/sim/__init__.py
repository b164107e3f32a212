"""The simulated arm, its surroundings and its skin, on MuJoCo: with the errors and noise of real ones."""
