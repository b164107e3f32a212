"""Other people's programs, unchanged, against simulated Franka arms."""
