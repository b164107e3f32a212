"""What proves Pretouch: the paper's experiments, weaknesses, benchmarks, sweeps and studies."""
