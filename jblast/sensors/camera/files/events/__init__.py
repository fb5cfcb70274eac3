"""Events as files: HDF5 in the layout of DSEC, npz, EVT3 and AEDAT4."""
