"""What proves Pretouch: the paper's experiments, benchmarks, sweeps and studies."""
