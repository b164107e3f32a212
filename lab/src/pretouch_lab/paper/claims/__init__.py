"""What the paper says of its method, measured: noise, anticipation, sensitivity."""
