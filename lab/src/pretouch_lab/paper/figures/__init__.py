"""The paper's figures in the paper's own layout, drawn from the traces of single trials. All can be read in grey."""
