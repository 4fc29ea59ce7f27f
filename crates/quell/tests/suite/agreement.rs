//! The back ends agree, stage by stage and over sequences; each comparison has a canary.
