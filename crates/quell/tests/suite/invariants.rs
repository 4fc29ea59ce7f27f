//! What must hold of the pipeline: energy, identity, sums of passes, reprojection.
