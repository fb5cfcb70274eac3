"""The file of a study: which scene, what is varied, what is asked of each sample."""
