"""Contact detectors on public recordings of real arms."""
