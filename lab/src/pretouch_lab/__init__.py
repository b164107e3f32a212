"""Evidence for Pretouch: the paper's experiments, benchmarks, sweeps and studies."""
