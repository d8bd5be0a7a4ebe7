"""The paper's rule: seven steps, one file each, in the order of `pipeline`."""
